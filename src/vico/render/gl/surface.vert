#version 450
// One invocation a corner: everything is pulled out of the scene's own arrays.
layout(std430, binding = 0) readonly buffer Vertices { float vertices[]; };
layout(std430, binding = 1) readonly buffer Triangles { ivec4 triangles[]; };
layout(std430, binding = 2) readonly buffer Entities { int entities[]; };
layout(std430, binding = 6) readonly buffer Matrices { float matrices[]; };
layout(std430, binding = 7) readonly buffer Owners { int owners[]; };
layout(std430, binding = 8) readonly buffer Chosen { int chosen[]; };

layout(std430, binding = 13) readonly buffer PastBodies { float past_bodies[]; };
layout(std430, binding = 14) readonly buffer PastThings { float past_things[]; };

uniform int base, first, is_instance, is_person, first_moving;
uniform vec3 eye, right, down, forward;
uniform vec2 scale;  // 2 * focal / size of the picture
uniform vec2 centre;  // of the picture, beside its optical axis, halves of its size
uniform float near;
uniform vec3 eye_moved;  // since the last look
uniform int with_past, first_vertex, bodies_known;

out vec3 place;  // from the eye, world's axes
out vec3 normal;
out vec3 colour;
out vec2 uv;
out float depth;
flat out int material, entity, moves, item;  // `item` is the number of the instance, or -1
out vec3 before;  // where it was, from where the eye was
flat out int is_known;

void main() {
    int number = base + gl_VertexID / 3;
    ivec4 triangle = triangles[number];
    int at = 12 * triangle[gl_VertexID % 3];
    vec3 position = vec3(vertices[at], vertices[at + 1], vertices[at + 2]);
    normal = vec3(vertices[at + 3], vertices[at + 4], vertices[at + 5]);
    uv = vec2(vertices[at + 6], vertices[at + 7]);
    colour = vec3(vertices[at + 8], vertices[at + 9], vertices[at + 10]);
    material = triangle.w;
    entity = entities[number];
    moves = is_person;
    item = -1;
    is_known = 1;
    before = vec3(0.0);
    if (is_instance != 0) {
        int i = chosen[first + gl_InstanceID], m = 12 * i;
        vec3 x = vec3(matrices[m], matrices[m + 4], matrices[m + 8]);
        vec3 y = vec3(matrices[m + 1], matrices[m + 5], matrices[m + 9]);
        vec3 z = vec3(matrices[m + 2], matrices[m + 6], matrices[m + 10]);
        vec3 origin = vec3(matrices[m + 3], matrices[m + 7], matrices[m + 11]);
        place = x * position.x + y * position.y + z * position.z + (origin - eye);
        normal = x * normal.x + y * normal.y + z * normal.z;
        if (entity == 0) entity = owners[i];
        moves = i >= first_moving ? 1 : 0;
        item = i;
    } else {
        place = position - eye;
    }
    if (with_past != 0) {
        before = place + eye_moved;
        if (is_person != 0) {
            int v = 3 * (triangle[gl_VertexID % 3] - first_vertex);
            is_known = bodies_known;
            if (bodies_known != 0) before = vec3(past_bodies[v], past_bodies[v + 1], past_bodies[v + 2]);
        } else if (moves != 0) {
            int m = 16 * (item - first_moving);
            is_known = past_things[m + 12] > 0.5 ? 1 : 0;
            for (int k = 0; k < 3; k++) {
                vec3 row = vec3(past_things[m + 4 * k], past_things[m + 4 * k + 1], past_things[m + 4 * k + 2]);
                before[k] = dot(row, position) + past_things[m + 4 * k + 3];
            }
        }
    }
    depth = dot(place, forward);
    // Rows of the picture go down: its first one is the lowest of the frame buffer.
    gl_Position = vec4(dot(place, right) * scale.x + centre.x * depth, dot(place, down) * scale.y + centre.y * depth, depth - 2.0 * near, depth);
}
