#version 450
layout(std430, binding = 10) readonly buffer Sky { uint sky[]; };
uniform int size, indoors;
in vec3 ray;
layout(location = 0) out vec4 out_colour;
layout(location = 1) out float out_depth;
layout(location = 2) out int out_entity;
layout(location = 3) out vec4 out_normal;

vec3 texel(int i, int j) {
    uint t = sky[(j & (size - 1)) * size + (i & (size - 1))];
    return vec3(t & 255u, (t >> 8) & 255u, (t >> 16) & 255u);
}

void main() {
    vec3 d = vec3(ray.xy, max(ray.z, 0.0));
    float s = 0.5 / (abs(d.x) + abs(d.y) + d.z);
    vec2 at = clamp((vec2(d.x + d.y, d.x - d.y) * s + 0.5) * float(size) - 0.5, vec2(0.0), vec2(float(size - 1)));
    vec2 low = floor(at), f = at - low;
    int i = int(low.x), j = int(low.y);
    vec3 c = mix(mix(texel(i, j), texel(i + 1, j), f.x), mix(texel(i, j + 1), texel(i + 1, j + 1), f.x), f.y);
    out_colour = vec4((indoors != 0 ? vec3(8.0, 8.0, 9.0) : floor(c)) / 255.0, 1.0);
    out_depth = 0.0;
    out_entity = 0;
    out_normal = vec4(0.0);
}
