#version 450
// What `vico.render.shading` does, pixel by pixel; see there for why.
layout(std430, binding = 3) readonly buffer Materials { int materials[]; };  // MATERIAL: 4 whole numbers, 1 real, 2 whole
layout(std430, binding = 4) readonly buffer Starts { int starts[]; };
layout(std430, binding = 5) readonly buffer Texels { uint texels[]; };
struct LitWindows { int building; float shares[2]; };  // LIT_WINDOWS
layout(std430, binding = 11) readonly buffer Windows { LitWindows windows[]; };  // ascending by building
layout(std430, binding = 9) readonly buffer Tone { int tone[]; };

layout(std430, binding = 12) readonly buffer Casters { vec4 casters[]; };  // see `packed_casters`
layout(std430, binding = 15) readonly buffer Cabins { float cabins[]; };  // see `packed_cabins`
layout(std430, binding = 16) readonly buffer Lamps { float lamps[]; };  // see `packed_lamps`
layout(std430, binding = 17) readonly buffer Beams { float beams[]; };  // see `packed_beams`

uniform usampler2D closeness;
uniform sampler2D relief;
uniform mat4x3 shadow_frame;
uniform vec3 relief_frame;  // corner, texels a metre
uniform vec3 eye, sun, sun_colour, ambient, tilt, haze, unlit;
uniform vec2 side;
uniform float near, far, haze_per_metre, lamp_exposure, wet, snow_cover, softness, glass, interiors, tone_scale;
uniform vec4 room_place, room_size;  // centre and cosine of the yaw; half length, half width, height, sine
uniform vec3 room_light;  // shares of lamps, of light all around, and of what windows show by day
uniform vec4 lamp_grid;  // corner, columns and rows of the cells
uniform ivec2 lamp_parts;  // where lamps and what cells name of them begin
uniform int indoors, hidden, most_taps, levels_each, is_person, caster_count, opening_count, beam_count, lit_count;

in vec3 place;
in vec3 normal;
in vec3 colour;
in vec2 uv;
in float depth;
in vec3 before;
flat in int material, entity, moves, item, is_known;

layout(location = 0) out vec4 out_colour;
layout(location = 1) out float out_depth;
layout(location = 2) out int out_entity;
layout(location = 3) out vec4 out_normal;
layout(location = 4) out vec4 out_before;

vec4 texel(int start, int columns, int rows, int i, int j) {
    uint t = texels[start + (j & (rows - 1)) * columns + (i & (columns - 1))];
    return vec4(t & 255u, (t >> 8) & 255u, (t >> 16) & 255u, t >> 24);
}

vec4 look_up(int start, int columns, int rows, vec2 at) {
    vec2 low = floor(at), f = at - low;
    int i = int(low.x), j = int(low.y);
    return mix(mix(texel(start, columns, rows, i, j), texel(start, columns, rows, i + 1, j), f.x),
               mix(texel(start, columns, rows, i, j + 1), texel(start, columns, rows, i + 1, j + 1), f.x), f.y);
}

// Colour in linear light, and alpha.
vec4 albedo(int log2_width, int log2_height, int levels, vec2 dx, vec2 dy) {
    vec2 size = vec2(1 << log2_width, 1 << log2_height);
    dx *= size;
    dy *= size;
    float long_x = dot(dx, dx), long_y = dot(dy, dy), longest = max(long_x, long_y);
    float area = max(abs(dx.x * dy.y - dy.x * dx.y), 0.0625 * longest);
    bool two = longest > 1.2 && longest >= 2.0 * area;
    bool four = two && longest >= 5.0 * area && most_taps >= 4;
    int taps = four ? 4 : (two ? 2 : 1);
    float between = four ? 0.0625 : (two ? 0.25 : 1.0);
    int level = clamp((int(floatBitsToUint(longest * between * 1.4) >> 23) - 127) >> 1, 0, levels - 1);
    int columns = 1 << max(log2_width - level, 0), rows = 1 << max(log2_height - level, 0);
    vec2 step = two ? (long_x >= long_y ? dx : dy) / size * vec2(columns, rows) : vec2(0.0);
    int start = starts[material * levels_each + level];
    vec4 sum = vec4(0.0);
    for (int k = 0; k < taps; k++) {
        float along = (float(k) + 0.5) / float(taps) - 0.5;
        sum += look_up(start, columns, rows, fract(uv) * vec2(columns, rows) - 0.5 + along * step);
    }
    vec4 c = sum / (float(taps) * 255.0);
    return vec4(c.rgb * (0.012522878 + c.rgb * (0.682171111 + c.rgb * 0.305306011)), c.a);
}

bool is_hole(int log2_width, int log2_height, int levels, vec2 dx, vec2 dy) {
    float area = abs(dx.x * dy.y - dx.y * dy.x) * float(1 << log2_width) * float(1 << log2_height);
    int level = 0;
    while (level < levels - 1 && area > 2.0) {
        area *= 0.25;
        level++;
    }
    int columns = 1 << max(log2_width - level, 0), rows = 1 << max(log2_height - level, 0);
    vec2 at = floor(uv * vec2(columns, rows));
    return texel(starts[material * levels_each + level], columns, rows, int(at.x), int(at.y)).w < 128.0;
}

// How much of the light of a building's windows is on, upper ones or those on the ground floor.
float windows_share(int floor_) {
    int low = 0, high = lit_count;
    while (low < high) {
        int middle = (low + high) >> 1;
        if (windows[middle].building < entity) low = middle + 1;
        else high = middle;
    }
    return low < lit_count && windows[low].building == entity ? windows[low].shares[floor_] : 1.0;
}

float sky_share(vec3 at, vec3 n) {
    vec2 p = (at.xy + 1.2 * n.xy - relief_frame.xy) * relief_frame.z - 0.5;
    vec2 size = vec2(textureSize(relief, 0));
    if (any(lessThan(p, vec2(0.0))) || any(greaterThanEqual(p, size - 1.0))) return 1.0;
    ivec2 i = ivec2(p);
    vec2 f = p - vec2(i);
    float low = mix(texelFetch(relief, i, 0).r, texelFetch(relief, i + ivec2(1, 0), 0).r, f.x);
    float high = mix(texelFetch(relief, i + ivec2(0, 1), 0).r, texelFetch(relief, i + ivec2(1, 1), 0).r, f.x);
    float deep = max(mix(low, high, f.y) - at.z, 0.0);
    return 1.0 - 0.62 * deep / (deep + 5.0);
}

float lit_at(ivec2 i, float level) {
    return float(texelFetch(closeness, i, 0).r) <= level ? 1.0 : 0.0;
}

float sun_share(vec3 at, vec3 n, vec2 aside) {
    vec3 p = shadow_frame * vec4(at + 0.2 * n, 1.0);
    vec2 q = p.xy - 0.5 + aside;
    vec2 size = vec2(textureSize(closeness, 0));
    if (any(lessThan(q, vec2(0.0))) || any(greaterThanEqual(q, size - 1.0))) return 1.0;
    ivec2 i = ivec2(q);
    vec2 f = q - vec2(i);
    return mix(mix(lit_at(i, p.z), lit_at(i + ivec2(1, 0), p.z), f.x),
               mix(lit_at(i + ivec2(0, 1), p.z), lit_at(i + ivec2(1, 1), p.z), f.x), f.y);
}

// Shadows of what moves: `vico.render.shadows`.
const int CASTER_ROWS = %CASTER_ROWS%;

float of_way(float from, float to, float soft) {
    float dark = clamp((to - max(from, 0.0)) * soft, 0.0, 1.0);
    return dark * dark * (3.0 - 2.0 * dark);
}

float ball_shadow(vec3 p, vec3 to, float soft) {
    float qa = dot(to, to), qb = dot(p, to), qc = dot(p, p) - 1.0;
    float root = sqrt(max(qb * qb - qa * qc, 0.0));
    return of_way((-qb - root) / qa, (-qb + root) / qa, soft);
}

float box_shadow(vec3 p, vec3 to, float soft) {
    vec3 t0 = vec3(0.0), t1 = vec3(0.0);
    for (int k = 0; k < 3; k++) {
        float inverse = 1.0 / (abs(to[k]) > 1e-9 ? to[k] : 1e-9);
        t0[k] = min((-1.0 - p[k]) * inverse, (1.0 - p[k]) * inverse);
        t1[k] = max((-1.0 - p[k]) * inverse, (1.0 - p[k]) * inverse);
    }
    return of_way(max(t0.x, max(t0.y, t0.z)), min(t1.x, min(t1.y, t1.z)), soft);
}

float limbs_shadow(int at, int count, vec3 p) {
    float darkest = 0.0;
    for (int k = 0; k < count; k++) {
        vec4 start = casters[at + 2 * k], rest = casters[at + 2 * k + 1];
        vec2 off = p.xy - start.xy;
        float way = clamp(dot(off, start.zw) * rest.x, 0.0, 1.0), ahead = rest.y + way * rest.z - p.z;
        float rim = min(0.03 + 0.012 * max(ahead, 0.0), 2.5 * rest.w);
        float dark = clamp((rest.w - length(off - way * start.zw)) / rim + 0.5, 0.0, 1.0);
        darkest = max(darkest, dark * clamp(ahead * 25.0, 0.0, 1.0));
    }
    return darkest * darkest * (3.0 - 2.0 * darkest);
}

const int CABIN_STEPS = %CABIN_STEPS%;
const int CABIN_SIZE = 18 + 2 * CABIN_STEPS;

float within(float depth_) {
    return clamp(depth_ + 0.5, 0.0, 1.0);
}

// What windows let in of the sun into a vehicle; below 0 outside of it. `vico.render.shadows.cabins`
float sun_in_cabin(int cabin, vec3 p, vec3 to) {
    int at = CABIN_SIZE * cabin;
    vec3 low = vec3(cabins[at], cabins[at + 1], cabins[at + 2]), high = vec3(cabins[at + 3], cabins[at + 4], cabins[at + 5]);
    if (any(lessThanEqual(p, low)) || any(greaterThanEqual(p, high))) return -1.0;
    vec3 inverse;
    for (int k = 0; k < 3; k++) inverse[k] = 1.0 / (abs(to[k]) > 1e-9 ? to[k] : 1e-9);
    vec3 ways = (mix(low, high, greaterThan(inverse, vec3(0.0))) - p) * inverse;
    vec3 hit = p + min(ways.x, min(ways.y, ways.z)) * to;
    float sharp_b = cabins[at + 14], sharp_c = cabins[at + 15];
    if (ways.y <= ways.x && ways.y <= ways.z) {
        float along = clamp((hit.x + 1.0) * 0.5, 0.0, 1.0) * float(CABIN_STEPS - 1);
        int k = min(int(along), CABIN_STEPS - 2), side = at + 18 + (inverse.y > 0.0 ? CABIN_STEPS : 0);
        float open = mix(cabins[side + k], cabins[side + k + 1], along - float(k));
        return open * within((hit.z - cabins[at + 6]) * sharp_c) * within((cabins[at + 7] - hit.z) * sharp_c);
    }
    if (ways.x < ways.y && ways.x <= ways.z) {
        int end = at + (inverse.x > 0.0 ? 8 : 10);
        return within((hit.z - cabins[end]) * sharp_c) * within((cabins[end + 1] - hit.z) * sharp_c)
            * within((cabins[at + 12] - abs(hit.y)) * sharp_b);
    }
    return 0.0;
}

// What moving things leave of the sun, and of the light at the ground; and whether this is inside a vehicle.
vec3 left_by_moving() {
    vec3 left = vec3(1.0, 1.0, 0.0);
    vec2 pixel = floor(gl_FragCoord.xy);
    vec4 here = vec4(place, 1.0);
    for (int k = 0; k < caster_count; k++) {
        int row = CASTER_ROWS * k;
        vec4 part = casters[row + 4], kind = casters[row + 5];
        if (pixel.x < part.x || pixel.x >= part.y || pixel.y < part.z || pixel.y >= part.w) continue;
        ivec3 owner = floatBitsToInt(casters[row + 10].xyz);
        bool own = owner.x >= 0 ? item == owner.x : (is_person != 0 && entity == owner.y);
        float above = place.z - kind.x;
        if ((own && owner.z < 0) || above > kind.y || above < -6.0) continue;
        vec3 unit = vec3(dot(casters[row], here), dot(casters[row + 1], here), dot(casters[row + 2], here));
        if (owner.z >= 0) {
            float sunlit = sun_in_cabin(owner.z, unit, casters[row + 3].xyz);
            if (sunlit >= 0.0) left *= vec3(sunlit, %UNDER_ROOF%, 1.0), left.z = 1.0;
            if (own || sunlit >= 0.0) continue;
        }
        bool is_round = kind.z > 0.5;
        if (indoors == 0) {
            vec4 sun_ = casters[row + 3];
            float dark;
            if (kind.w > 0.5) {
                vec3 across = vec3(dot(casters[row + 6], here), dot(casters[row + 7], here), dot(casters[row + 8], here));
                dark = limbs_shadow(row + 11, int(kind.w), across);
            } else {
                dark = is_round ? ball_shadow(unit, sun_.xyz, sun_.w) : box_shadow(unit, sun_.xyz, sun_.w);
            }
            left.x *= 1.0 - dark;
        }
        float foot = is_round ? (1.0 - length(unit.xy) / 2.0) * 1.5 : (1.0 - max(abs(unit.x), abs(unit.y)) / 1.25) * 4.0;
        left.y *= 1.0 - min(max(foot, 0.0) * max(1.0 - abs(above) / 0.5, 0.0), 0.75);
    }
    return left;
}

// Light of lamps: `vico.render.shading.lamplight`.
float lamp_on(vec3 to, vec3 axis, vec2 cone, vec2 power, float inverse_reach, vec3 n) {
    float squared = dot(to, to) + 1e-4, inverse = inversesqrt(squared);
    float facing = max(dot(to, n) * inverse + %AROUND_CORNER%, 0.0);
    float thrown = clamp(cone.y - cone.x * dot(to, axis) * inverse, 0.0, 1.0);
    float left = max(1.0 - squared * inverse_reach, 0.0);
    return power.x * facing * thrown * left * left / (squared + power.y);
}

float headlights(vec3 at, vec3 n) {
    float sum = 0.0;
    for (int k = 0; k < beam_count; k++) {
        int b = 12 * k;
        vec3 to = vec3(beams[b], beams[b + 1], beams[b + 2]) - at, axis = vec3(beams[b + 3], beams[b + 4], beams[b + 5]);
        vec2 cone = vec2(beams[b + 6], beams[b + 7]), power = vec2(beams[b + 8] * lamp_exposure, beams[b + 9]);
        sum += lamp_on(to, axis, cone, power, beams[b + 10], n);
    }
    return sum;
}

float lamplight(vec3 at, vec3 n) {
    if (lamp_grid.w == 0.0) return 0.0;
    vec2 cell = (at.xy + 1.2 * n.xy - lamp_grid.xy) / %CELL%, low = floor(cell);
    if (any(lessThan(low, vec2(0.0))) || any(greaterThanEqual(low, lamp_grid.zw))) return 0.0;
    vec2 st = clamp((at.xy + %BEFORE% * n.xy - lamp_grid.xy) / %CELL% - low, 0.0, 1.0);
    int k = int(low.y) * int(lamp_grid.z) + int(low.x);
    float sum = 0.0;
    for (int i = floatBitsToInt(lamps[k]); i < floatBitsToInt(lamps[k + 1]); i++) {
        int one = lamp_parts.y + 5 * i, lamp = lamp_parts.x + 12 * floatBitsToInt(lamps[one]);
        vec3 to = vec3(lamps[lamp], lamps[lamp + 1], lamps[lamp + 2]) - at;
        vec3 axis = vec3(lamps[lamp + 3], lamps[lamp + 4], lamps[lamp + 5]);
        vec2 cone = vec2(lamps[lamp + 6], lamps[lamp + 7]), power = vec2(lamps[lamp + 8], lamps[lamp + 9]);
        float comes = mix(mix(lamps[one + 1], lamps[one + 2], st.x), mix(lamps[one + 3], lamps[one + 4], st.x), st.y);
        sum += comes * lamp_on(to, axis, cone, power, lamps[lamp + 10], n);
    }
    return sum;
}

vec3 in_room(vec3 at, vec3 n, vec3 base, float glass_) {
    vec3 p = at - room_place.xyz;
    float c = room_place.w, s = room_size.w, height = room_size.z;
    float lz = 0.92 * height - p.z;
    float squared = p.x * p.x + p.y * p.y + lz * lz;
    float facing = (lz * n.z - p.x * n.x - p.y * n.y) / sqrt(squared + 1e-6);
    float lamp = 0.62 * max(facing, 0.0) / (1.0 + squared * 2.0 / (dot(room_size.xy, room_size.xy) + 6.0));
    float a = room_size.x - abs(p.x * c + p.y * s), b = room_size.y - abs(p.y * c - p.x * s);
    float up = min(p.z, height - p.z);
    float second = max(max(min(a, b), min(max(a, b), up)), 0.0);
    float corner = 1.0 - 0.30 / (1.0 + second * second * 9.0);
    vec2 light = mix(room_light.xy, room_light.zz, min(glass_, 1.0));
    vec3 tint = vec3(1.0 + 0.04 * room_light.x, 1.0, 1.0 - 0.07 * room_light.x);
    return base * ((0.36 + 0.05 * n.z + 0.03 * n.x) * light.y + lamp * light.x) * corner * tint;
}

float share_of(uint number, int low) {
    return float((number >> low) & 255u) / 255.0;
}

// What is behind a pane of an upper floor or a plain ground floor: `look_into_windows`.
vec3 room_behind(vec3 way_to, vec3 n, float storeys, float shine) {  // `shine` is 0 where no lamp is on
    vec3 to = way_to / max(length(way_to), 1e-12);
    float ahead = max(-dot(to.xy, n.xy), 0.02), aside = to.y * n.x - to.x * n.y, up = to.z;
    vec2 cell = uv * vec2(8.0, storeys), corner = floor(cell), at = (cell - corner) * vec2(3.2, 2.9);
    uint bay = uint(int(corner.x) & 7), storey = uint(int(corner.y) & 3);
    uint number = uint(entity) * 0x9E3779B1u;
    number ^= (bay * 4u + storey + 1u) * 0x85EBCA6Bu;
    number = (number ^ (number >> 15)) * 0x2C1B3C6Du;
    number ^= number >> 13;
    float first = share_of(number, 0), second = share_of(number, 8), third = share_of(number, 16);
    float deep = 2.6 + 2.4 * first;
    float to_side = (aside > 0.0 ? 3.2 - at.x : at.x) / max(abs(aside), 1e-4);
    float to_level = (up > 0.0 ? 2.9 - at.y : at.y) / max(abs(up), 1e-4);
    float to_back = deep / ahead, to_thing = 0.62 * deep / ahead;
    float way = min(to_side, min(to_level, to_back));
    bool is_level = to_level <= to_side && to_level <= to_back, is_back = to_back < to_side && to_back < to_level;
    vec2 t = at + vec2(aside, up) * to_thing;
    float left = 0.3 + 1.4 * second;
    bool is_thing = to_thing < way && t.x > left && t.x < left + 1.1 && t.y < 0.7 + 1.2 * third;
    way = is_thing ? to_thing : way;
    vec3 hit = vec3(at.x + aside * way, ahead * way, at.y + up * way);
    bool is_frame = is_back && abs(hit.x - 0.7 - 1.6 * third) < 0.36 && abs(hit.z - 1.65) < 0.28;
    float warm = 0.50 + 0.34 * second, dark = 0.12 + 0.22 * first;
    vec3 base = vec3(warm, warm * (0.90 + 0.08 * third), warm * (0.70 + 0.25 * first));
    if (is_level) base = up > 0.0 ? vec3(0.82, 0.80, 0.76) : vec3(0.30, 0.20, 0.12);
    if (is_frame) base = vec3(0.22, 0.26, 0.30);
    if (is_thing) base = dark * vec3(1.0, 0.8, 0.62);
    vec3 away = hit - vec3(1.6, 0.5 * deep, 2.5);
    float glow = is_level && up > 0.0 && dot(away.xy, away.xy) < 0.05 ? 2.2 : 0.0;
    float lamp = (1.7 / (1.0 + 1.6 * dot(away, away)) + 0.06 + glow) * shine * 1.25;
    float daylight = 0.26 / (1.0 + 0.30 * hit.y) * (1.0 - 0.8 * min(lamp_exposure / 1.6, 1.0));
    return base * (daylight * ambient + lamp * vec3(1.0, 0.84, 0.58));
}

// Within a door that is not closed, of what never moves nothing is drawn: `vico.render.visibility.openings`.
uniform vec4 openings[48];  // three a door: see `packed_openings`

bool is_cut() {
    for (int k = 0; k < opening_count; k++) {
        vec4 sill = openings[3 * k], ways = openings[3 * k + 1], reach = openings[3 * k + 2];
        vec3 d = place - sill.xyz;
        float a = d.x * ways.y - d.y * ways.x, b = d.x * ways.x + d.y * ways.y;
        if (abs(a) < sill.w && b > -reach.x && b < reach.y && d.z > 0.0 && d.z < ways.z) return true;
    }
    return false;
}

void main() {
    int log2_width = materials[7 * material], log2_height = materials[7 * material + 1];
    int levels = materials[7 * material + 2], flags = materials[7 * material + 3];
    float emission = intBitsToFloat(materials[7 * material + 4]);
    int column = materials[7 * material + 5];
    if (column > 0) emission *= windows_share(column - 1);
    bool both = (flags & 2) != 0;
    vec2 dx = dFdx(uv), dy = dFdy(uv);
    if (depth >= far || (hidden != 0 && entity == hidden) || (!gl_FrontFacing && !both)) discard;
    if (moves == 0 && is_cut()) discard;
    if ((flags & 1) != 0 && (levels == 0 || is_hole(log2_width, log2_height, levels, dx, dy))) discard;
    vec3 n = normalize(normal), at = eye + place;
    if (both && dot(n, place) > 0.0) n = -n;
    vec4 base = vec4(colour, 1.0);
    if (levels > 0) {
        vec4 found = albedo(log2_width, log2_height, levels, dx, dy);
        base = vec4(base.rgb * found.rgb, found.a);
    }
    vec3 light;
    float seen = 0.0;
    vec3 left = left_by_moving();
    if (indoors != 0) {
        light = in_room(at, n, base.rgb, levels > 0 ? emission * base.a : 0.0) * (0.4 + 0.6 * left.y);
    } else {
        bool dark = unlit.z > 0.0 && moves == 0 && distance(at.xy, unlit.xy) <= unlit.z;
        float shine = dark ? 0.0 : emission * lamp_exposure * base.a;
        if (is_person == 0 && left.z == 0.0) {
            float ground = clamp(n.z * 8.0 - 6.6, 0.0, 1.0);
            float share = clamp((n.z - 0.25) * 2.2, 0.0, 1.0);
            share = snow_cover * share * share * (3.0 - 2.0 * share);
            float bare = (1.0 - share) * (1.0 - 0.45 * wet * (0.3 + 0.7 * ground));
            base.rgb = base.rgb * bare + vec3(0.86, 0.86, 0.90) * share;
            shine *= 1.0 - share;
        }
        float facing = max(dot(n, sun), 0.0);
        facing *= left.x;
        if (facing > 0.0) {
            if (softness > 0.0) {
                facing *= 0.25 * (sun_share(at, n, softness * vec2(0.8, 0.35)) + sun_share(at, n, softness * vec2(-0.35, 0.8))
                    + sun_share(at, n, softness * vec2(-0.8, -0.35)) + sun_share(at, n, softness * vec2(0.35, -0.8)));
            } else {
                facing *= sun_share(at, n, vec2(0.0));
            }
        }
        float length_ = length(place), thick = length_ * haze_per_metre;
        float clear = 1.0 / (1.0 + thick * (1.0 + thick * (0.5 + thick * 0.1666)));
        float toward = max(dot(place, sun) / max(length_, 1e-12), 0.0);
        float glow = 0.10 * toward * toward * toward;
        vec3 around = (ambient + n.z * tilt + dot(n.xy, side)) * sky_share(at, n) * left.y;
        float lamp = (lamplight(at, n) + headlights(at, n)) * left.y;
        light = base.rgb * (facing * sun_colour + around + (shine + lamp) * vec3(1.0, 0.86, 0.62));
        light = (1.0 - clear) * (haze + glow * sun_colour) + clear * light;
        light += left.z * lamp_exposure * (%CABIN_LAMP% + %CABIN_TILT% * n.z) * vec3(1.0, %CABIN_GREEN%, %CABIN_BLUE%) * base.rgb;
        if (interiors > 0.0 && column > 0 && levels > 0) {
            float ahead = max(-dot(place.xy, n.xy) / max(length_, 1e-12), 0.02);
            float pane = min(base.a * 50.0, 1.0) * clamp(1.0 - 3.0 * abs(n.z), 0.0, 1.0);
            pane *= 0.90 * (1.0 - pow(1.0 - min(ahead, 1.0), 5.0)) * clamp((70.0 - length_) / 25.0, 0.0, 1.0);
            seen = column == 2 ? pane : 0.0;
            int storeys = materials[7 * material + 6];
            if (storeys > 0 && pane > 0.0) light = mix(light, room_behind(place, n, float(storeys), base.a > 0.1 ? shine : 0.0), 0.66 * pane);
        }
        if (glass > 0.0) {
            float front = clamp(-dot(place, n) / max(length_, 1e-12), 0.0, 1.0);
            float fresnel = 0.10 + 0.9 * pow(1.0 - front, 5.0);
            float share = glass * min(shine / max(lamp_exposure, 1e-12), 1.0) * clamp(1.0 - 3.0 * abs(n.z), 0.0, 1.0) * fresnel;
            float up = place.z / max(length_, 1e-12) + 2.0 * front * n.z;
            vec3 sky = mix(haze, ambient + tilt, clamp(1.3 * up, 0.0, 1.0));
            light = mix(light, mix(0.42 * ambient, sky, clamp((up - 0.10) * 3.0, 0.0, 1.0)), share);
        }
    }
    ivec3 row = ivec3(clamp(light * tone_scale, vec3(0.0), vec3(4095.0)));
    out_colour = vec4(tone[row.r], tone[row.g], tone[row.b], floor(255.0 * seen)) / 255.0;
    out_depth = depth;
    out_entity = entity;
    out_normal = vec4(n, 0.0);
    out_before = vec4(before, float(is_known));
    gl_FragDepth = log2(depth / near) / log2(far / near);
}
