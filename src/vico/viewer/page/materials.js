// How surfaces look: light by vertex, shadows of buildings, textures from arrays, windows and lamps that shine at night, fog.

import { PANES, paneTexture } from "./pictures.js";
import { THREE } from "./three.js";

/** Light by vertex; with `SHADED` that of the sun is kept apart, for buildings may stand in its way. */
export const LIGHT_VERTEX = /* glsl */ `
uniform vec3 sun, sunColour, sky, ground;
uniform float reach;
varying vec3 vLight;
varying float vFog;
#ifdef SHADED
varying vec3 vDirect, vAt;
#endif
void shine(vec3 n, vec3 at) {
  vLight = mix(ground, sky, n.z * 0.5 + 0.5);
  vec3 direct = sunColour * max(dot(n, sun), 0.0);
  #ifdef SHADED
  vDirect = direct;
  vAt = at;
  #else
  vLight += direct;
  #endif
}
float fogAt(vec3 view) { float d = length(view) / reach; return 1.0 - exp(-d * d * 0.6); }
`;
/** How much of the sun's light comes to a point: none below the height up to which a building's shadow reaches there. */
export const SHADE = /* glsl */ `
uniform sampler2D shade;
uniform vec4 shadeFrame;
float sunReaches(vec3 at) {
  // Rooms lie below the lowest ground: no house shades them.
  if (at.z < shadeFrame.w) return 1.0;
  float height = texture2D(shade, (at.xy + shadeFrame.yz) * shadeFrame.x + 0.5).r + shadeFrame.w;
  return 1.0 - clamp((height - at.z - 0.25) * 1.4, 0.0, 1.0);
}
`;
const LIGHT_FRAGMENT = /* glsl */ `
#define SNOW vec3(0.97, 0.99, 1.03)
uniform vec3 fog;
varying vec3 vLight;
varying float vFog;
#ifdef SHADED
varying vec3 vDirect, vAt;
${SHADE}
vec3 light() { return vLight + vDirect * sunReaches(vAt); }
#else
vec3 light() { return vLight; }
#endif
`;

const CITY_VERTEX = /* glsl */ `
attribute vec4 facing;
attribute vec4 tint;
uniform float snow, wet;
varying vec2 vUv;
varying vec3 vTint;
flat varying float vLayer, vGlow;
varying float vSnow;
#ifdef CUTOUT
flat varying float vHoles;
#endif
${LIGHT_VERTEX}
void main() {
  vec4 at = vec4(position, 1.0);
  vec3 n = facing.xyz;
  #ifdef USE_INSTANCING
  at = instanceMatrix * at;
  n = mat3(instanceMatrix) * n;
  #endif
  at = modelMatrix * at;
  n = normalize(mat3(modelMatrix) * n);
  shine(n, at.xyz);
  vUv = uv;
  vLayer = floor(tint.a * 255.0 + 0.5);
  vTint = tint.rgb;
  #ifdef USE_INSTANCING_COLOR
  vTint *= instanceColor;
  #endif
  #ifdef CUTOUT
  vHoles = facing.w > 0.9 ? 1.0 : 0.0;
  #endif
  vGlow = facing.w > 0.9 ? 0.0 : min(facing.w * 1.27, 1.0);
  float level = smoothstep(0.6, 0.9, n.z);
  vTint *= 1.0 - 0.3 * wet * level;
  vSnow = snow * level * 0.85;
  vec4 view = viewMatrix * at;
  vFog = fogAt(view.xyz);
  gl_Position = projectionMatrix * view;
}`;

// Only what has holes may throw fragments away: of everything else those that are hidden cost nothing.
const CITY_FRAGMENT = /* glsl */ `
precision highp sampler2DArray;
uniform sampler2DArray pictures;
uniform float night;
varying vec2 vUv;
varying vec3 vTint;
flat varying float vLayer, vGlow;
varying float vSnow;
#ifdef CUTOUT
flat varying float vHoles;
#endif
#ifdef PLAIN_LAYER
uniform vec3 outdoors;
#endif
${LIGHT_FRAGMENT}
void main() {
  vec4 texel = texture(pictures, vec3(vUv, vLayer));
  #ifdef CUTOUT
  if (vHoles > 0.5 && texel.a < 0.5) discard;
  #endif
  vec3 base = mix(texel.rgb * vTint, SNOW, vSnow);
  vec3 colour = base * light();
  #ifdef PLAIN_LAYER
  // What is painted in a room and gives light is a window: it is as bright as the sky outside.
  if (vGlow > 0.0 && vLayer > PLAIN_LAYER) colour *= mix(vec3(0.06, 0.07, 0.12), vec3(1.0), clamp((outdoors.b - 0.2) / 0.45, 0.0, 1.0));
  else
  #endif
  if (night > 0.0) colour = mix(colour, base * vec3(1.25, 1.05, 0.75) + vec3(0.16, 0.11, 0.04), vGlow * texel.a * night);
  gl_FragColor = vec4(mix(colour, fog, vFog), 1.0);
}`;

const PLAIN_VERTEX = /* glsl */ `
attribute vec4 facing;
attribute vec4 tint;
uniform float snow;
varying vec3 vColour;
varying vec2 vUv;
varying float vSnow, vUpright;
${LIGHT_VERTEX}
void main() {
  vec3 n = facing.xyz;
  shine(n, position);
  #ifdef PICTURED
  vUv = uv;
  #else
  vUv = vec2(dot(position.xy, vec2(-n.y, n.x)), position.z) / PANES;
  vUpright = 1.0 - smoothstep(0.1, 0.3, abs(n.z));
  #endif
  vColour = tint.rgb;
  vSnow = snow * smoothstep(0.6, 0.9, n.z) * 0.85;
  vec4 view = viewMatrix * vec4(position, 1.0);
  vFog = fogAt(view.xyz);
  gl_Position = projectionMatrix * view;
}`;

// Far walls have no textures of their own: storeys of windows are drawn on them by height, lit here and there at night.
const PLAIN_FRAGMENT = /* glsl */ `
uniform float night;
uniform sampler2D picture;
varying vec3 vColour;
varying vec2 vUv;
varying float vSnow, vUpright;
${LIGHT_FRAGMENT}
void main() {
  vec3 shining = light();
  #ifdef PICTURED
  vec3 colour = mix(vColour * texture2D(picture, vUv).rgb, SNOW, vSnow) * shining;
  #else
  vec3 colour = mix(vColour, SNOW, vSnow) * shining;
  vec2 pane = texture2D(picture, vUv).rg * (0.7 * vUpright);
  colour += vec3(0.22, 0.25, 0.3) * shining * (pane.r - pane.g * night) + vec3(1.5, 1.2, 0.75) * (pane.g * night) - colour * pane.r;
  #endif
  gl_FragColor = vec4(mix(colour, fog, vFog), 1.0);
}`;

/**
 * Return what all materials of a scene share in uniforms.
 * @param {import("./light.js").Light} light
 * @returns {Record<string, any>}
 */
export function lightUniforms(light) {
  const { sun, sunColour, sky, ground, fog, reach, night, snow, wet, shade, shadeFrame } = light;
  return { sun, sunColour, sky, ground, fog, reach, night, snow, wet, shade, shadeFrame };
}

/**
 * Make a material that buildings cast their shadows on.
 * @param {import("./light.js").Light} light
 * @param {Record<string, any>} options of `THREE.ShaderMaterial`
 */
export function shadedMaterial(light, options) {
  const material = new THREE.ShaderMaterial({ ...options, defines: { ...options.defines, ...(light.shaded ? { SHADED: 1 } : {}) } });
  light.receivers.add(material);
  return material;
}

/**
 * Have all materials show the shadows of buildings, or none: a share of the work where no graphics card does it.
 * @param {import("./light.js").Light} light
 * @param {boolean} on
 */
export function setShaded(light, on) {
  if (on === light.shaded) return;
  light.shaded = on;
  for (const material of light.receivers) {
    if (on) material.defines.SHADED = 1;
    else delete material.defines.SHADED;
    material.needsUpdate = true;
  }
}

/**
 * Return the material of everything textured that lies in one texture array.
 * @param {import("./light.js").Light} light
 * @param {{value: any}} pictures a texture array
 * @param {boolean} [inside] of rooms
 * @param {boolean} [both] whether it is seen from behind too
 * @param {boolean} [white] whether its first layer is that of what has no texture
 */
export function cityMaterial(light, pictures, inside = false, both = false, white = false) {
  const options = {
    uniforms: { ...lightUniforms(light), ...(inside ? { ...insideLight(), outdoors: light.sky } : {}), pictures },
    defines: { ...(both ? { CUTOUT: 1 } : {}), ...(inside ? { PLAIN_LAYER: white ? "0.5" : "-0.5" } : {}) },
    vertexShader: CITY_VERTEX,
    fragmentShader: CITY_FRAGMENT,
    // Walls of rooms are seen from inside alone, so that one can look in from anywhere.
    side: both ? THREE.DoubleSide : THREE.FrontSide,
  };
  return inside ? new THREE.ShaderMaterial(options) : shadedMaterial(light, options);
}

/** Lamps of rooms, whatever the time. */
export function insideLight() {
  return {
    sunColour: { value: new THREE.Color(0.22, 0.21, 0.19) },
    sun: { value: new THREE.Vector3(0.35, 0.25, 0.9) },
    sky: { value: new THREE.Color(0.78, 0.76, 0.72) },
    ground: { value: new THREE.Color(0.5, 0.49, 0.47) },
    reach: { value: 4000 },
    snow: { value: 0 },
    wet: { value: 0 },
  };
}

/**
 * Return the material of far buildings, or with a picture that of the far ground.
 * @param {import("./light.js").Light} light
 * @param {boolean} fine whether a graphics card paints
 * @param {any} [picture]
 */
export function plainMaterial(light, fine, picture = null) {
  return shadedMaterial(light, {
    uniforms: { ...lightUniforms(light), picture: { value: picture ?? paneTexture(fine) } },
    defines: picture ? { PICTURED: 1 } : { PANES },
    vertexShader: PLAIN_VERTEX,
    fragmentShader: PLAIN_FRAGMENT,
  });
}

/**
 * Make the geometry of a packed mesh.
 * @param {ArrayBuffer} buffer
 * @param {any} entry of the manifest
 */
export function meshGeometry(buffer, entry) {
  const n = entry.vertices;
  let at = entry.offset;
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(buffer, at, 3 * n), 3));
  at += 12 * n;
  geometry.setAttribute("facing", new THREE.BufferAttribute(new Int8Array(buffer, at, 4 * n), 4, true));
  at += 4 * n;
  geometry.setAttribute("uv", new THREE.BufferAttribute(new Float32Array(buffer, at, 2 * n), 2));
  at += 8 * n;
  geometry.setAttribute("tint", new THREE.BufferAttribute(new Uint8Array(buffer, at, 4 * n), 4, true));
  at += 4 * n;
  geometry.userData.entity = new Int32Array(buffer, at, n);
  at += 4 * n;
  const Index = n < 65536 ? Uint16Array : Uint32Array;
  geometry.setIndex(new THREE.BufferAttribute(new Index(buffer, at, entry.indices), 1));
  const low = new THREE.Vector3(...entry.low);
  const high = new THREE.Vector3(...entry.high);
  geometry.boundingBox = new THREE.Box3(low, high);
  geometry.boundingSphere = geometry.boundingBox.getBoundingSphere(new THREE.Sphere());
  return geometry;
}
