// How surfaces look: light by vertex, textures from arrays, windows and lamps that shine at night, fog.

import { THREE } from "./three.js";

const LIGHT_VERTEX = /* glsl */ `
uniform vec3 sun, sunColour, sky, ground;
uniform float reach;
varying vec3 vLight;
varying float vFog;
vec3 lit(vec3 n) {
  return mix(ground, sky, n.z * 0.5 + 0.5) + sunColour * max(dot(n, sun), 0.0);
}
float fogAt(vec3 view) { float d = length(view) / reach; return 1.0 - exp(-d * d * 0.6); }
`;
const FOG_FRAGMENT = /* glsl */ `
#define SNOW vec3(0.97, 0.99, 1.03)
uniform vec3 fog;
varying vec3 vLight;
varying float vFog;
`;

const CITY_VERTEX = /* glsl */ `
attribute vec4 facing;
attribute vec4 tint;
uniform float snow, wet;
varying vec2 vUv;
varying vec4 vTint;
varying float vFlag, vSnow;
${LIGHT_VERTEX}
void main() {
  vec4 at = vec4(position, 1.0);
  vec3 n = facing.xyz;
  #ifdef USE_INSTANCING
  at = instanceMatrix * at;
  n = normalize(mat3(instanceMatrix) * n);
  #endif
  at = modelMatrix * at;
  n = normalize(mat3(modelMatrix) * n);
  vLight = lit(n);
  vUv = uv;
  vTint = vec4(tint.rgb, tint.a * 255.0);
  #ifdef USE_INSTANCING_COLOR
  vTint.rgb *= instanceColor;
  #endif
  vFlag = facing.w;
  float level = smoothstep(0.6, 0.9, n.z);
  vTint.rgb *= 1.0 - 0.3 * wet * level;
  vSnow = snow * level * 0.85;
  vec4 view = viewMatrix * at;
  vFog = fogAt(view.xyz);
  gl_Position = projectionMatrix * view;
}`;

const CITY_FRAGMENT = /* glsl */ `
precision highp sampler2DArray;
uniform sampler2DArray pictures;
uniform float night;
varying vec2 vUv;
varying vec4 vTint;
varying float vFlag, vSnow;
${FOG_FRAGMENT}
void main() {
  vec4 texel = texture(pictures, vec3(vUv, floor(vTint.a + 0.5)));
  vec3 base = mix(texel.rgb * vTint.rgb, SNOW, vSnow);
  vec3 colour = base * vLight;
  if (vFlag > 0.9) { if (texel.a < 0.5) discard; }
  else {
    float shine = min(vFlag * 1.27, 1.0) * texel.a;
    colour = mix(colour, base * vec3(1.25, 1.05, 0.75) + vec3(0.16, 0.11, 0.04), shine * night);
  }
  gl_FragColor = vec4(mix(colour, fog, vFog), 1.0);
}`;

const PLAIN_VERTEX = /* glsl */ `
attribute vec4 facing;
attribute vec4 tint;
uniform float snow;
varying vec3 vColour;
varying vec2 vUv;
varying vec3 vWall;
varying float vSnow;
${LIGHT_VERTEX}
void main() {
  vec4 at = modelMatrix * vec4(position, 1.0);
  vec3 n = facing.xyz;
  vLight = lit(n);
  vWall = vec3(dot(position.xy, vec2(-n.y, n.x)), position.z, 1.0 - smoothstep(0.1, 0.3, abs(n.z)));
  vUv = uv;
  vColour = tint.rgb;
  vSnow = snow * smoothstep(0.6, 0.9, n.z) * 0.85;
  vec4 view = viewMatrix * at;
  vFog = fogAt(view.xyz);
  gl_Position = projectionMatrix * view;
}`;

// Far walls have no textures: storeys are drawn on them by height, and lit here and there at night.
const PLAIN_FRAGMENT = /* glsl */ `
uniform float night;
uniform float pictured;
uniform sampler2D picture;
varying vec3 vColour;
varying vec2 vUv;
varying vec3 vWall;
varying float vSnow;
${FOG_FRAGMENT}
void main() {
  vec3 base = vColour;
  if (pictured > 0.5) base *= texture2D(picture, vUv).rgb;
  else if (vWall.z > 0.5) {
    vec2 cell = vWall.xy / vec2(2.7, 3.5);
    // As large a share of a pixel as panes have of it; where pixels are storeys, their mean.
    vec2 wide = max(fwidth(cell), vec2(1e-3));
    vec2 within = fract(cell);
    vec2 cover = clamp((within - vec2(0.28, 0.3)) / wide + 0.5, 0.0, 1.0) - clamp((within - vec2(0.74, 0.8)) / wide + 0.5, 0.0, 1.0);
    float blurred = smoothstep(0.25, 0.7, max(wide.x, wide.y));
    float pane = mix(cover.x * cover.y, 0.23, blurred);
    float chance = night > 0.1 ? fract(sin(dot(floor(cell), vec2(12.9898, 78.233))) * 43758.5453) : 0.0;
    float lamp = mix(step(0.62, chance), 0.38, blurred);
    vec3 glass = mix(vec3(0.22, 0.25, 0.3), vec3(1.5, 1.2, 0.75) / max(vLight, vec3(0.2)), night * lamp);
    base = mix(base, glass, pane * 0.7);
  }
  base = mix(base, SNOW, vSnow);
  gl_FragColor = vec4(mix(base * vLight, fog, vFog), 1.0);
}`;

/**
 * Return what all materials of a scene share in uniforms.
 * @param {import("./light.js").Light} light
 * @returns {Record<string, any>}
 */
export function lightUniforms(light) {
  const { sun, sunColour, sky, ground, fog, reach, night, snow, wet } = light;
  return { sun, sunColour, sky, ground, fog, reach, night, snow, wet };
}

/**
 * Return the material of everything textured that lies in one texture array.
 * @param {import("./light.js").Light} light
 * @param {{value: any}} pictures a texture array
 * @param {boolean} [inside] of rooms
 * @param {boolean} [both] whether it is seen from behind too
 */
export function cityMaterial(light, pictures, inside = false, both = false) {
  return new THREE.ShaderMaterial({
    uniforms: { ...lightUniforms(light), ...(inside ? insideLight() : {}), pictures },
    vertexShader: CITY_VERTEX,
    fragmentShader: CITY_FRAGMENT,
    // Walls of rooms are seen from inside alone, so that one can look in from anywhere.
    side: both ? THREE.DoubleSide : THREE.FrontSide,
  });
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
 * @param {any} [picture]
 */
export function plainMaterial(light, picture = null) {
  return new THREE.ShaderMaterial({
    uniforms: { ...lightUniforms(light), picture: { value: picture }, pictured: { value: picture ? 1 : 0 } },
    vertexShader: PLAIN_VERTEX,
    fragmentShader: PLAIN_FRAGMENT,
  });
}

/**
 * Make a texture array whose layers come later: white until then.
 * @param {{width: number, height: number}} size
 * @param {number} layers
 * @param {Uint8Array} [data]
 * @param {boolean} [fine] whether colours pass from level to level: twice the work where no graphics card does it
 */
export function pictureArray(size, layers, data, fine = true) {
  const white = data ?? new Uint8Array(4).fill(255);
  const texture = data
    ? new THREE.DataArrayTexture(data, size.width, size.height, layers)
    : new THREE.DataArrayTexture(white, 1, 1, 1);
  texture.format = THREE.RGBAFormat;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.magFilter = THREE.LinearFilter;
  texture.minFilter = !data ? THREE.LinearFilter : fine ? THREE.LinearMipmapLinearFilter : THREE.LinearMipmapNearestFilter;
  texture.generateMipmaps = Boolean(data);
  texture.needsUpdate = true;
  return texture;
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
