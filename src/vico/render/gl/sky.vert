#version 450
uniform vec3 right, down, forward;
uniform vec2 scale;
out vec3 ray;

void main() {
    vec2 corner = vec2(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0);
    ray = forward + corner.x / scale.x * right + corner.y / scale.y * down;
    gl_Position = vec4(corner, 0.0, 1.0);
}
