// How somebody on legs is painted: skinned by the bones of their row, in plain colours by vertex.

import { THREE } from "./three.js";
import { SHADE, insideLight, lightUniforms, shadedMaterial } from "./materials.js";

const VERTEX = /* glsl */ `
attribute vec4 colour, joints, weights;
uniform sampler2D bones;
uniform float row;
uniform vec3 sun, sunColour, sky, ground;
uniform float reach, snow, lamp;
varying vec3 vColour;
varying float vFog;
#ifdef SHADED
${SHADE}
#endif
mat4 bone(float joint) {
  int x = 3 * int(joint + 0.5), y = int(row + 0.5);
  vec4 a = texelFetch(bones, ivec2(x, y), 0), b = texelFetch(bones, ivec2(x + 1, y), 0), c = texelFetch(bones, ivec2(x + 2, y), 0);
  return transpose(mat4(a, b, c, vec4(0.0, 0.0, 0.0, 1.0)));
}
void main() {
  mat4 m = weights.x * bone(joints.x);
  if (weights.y > 0.0) m += weights.y * bone(joints.y);
  if (weights.z > 0.0) m += weights.z * bone(joints.z);
  if (weights.w > 0.0) m += weights.w * bone(joints.w);
  vec4 at = modelMatrix * (m * vec4(position, 1.0));
  vec3 n = normalize(mat3(modelMatrix) * (mat3(m) * normal));
  vec3 direct = sunColour * max(dot(n, sun), 0.0);
  #ifdef SHADED
  direct *= sunReaches(modelMatrix[3].xyz + vec3(0.0, 0.0, 1.0));
  #endif
  vec3 light = mix(ground, sky, n.z * 0.5 + 0.5) + direct;
  // Street lamps shine from above.
  light += vec3(1.0, 0.8, 0.52) * lamp * (n.z * 0.35 + 0.65);
  vColour = colour.rgb * light;
  vec4 view = viewMatrix * at;
  float d = length(view.xyz) / reach;
  vFog = 1.0 - exp(-d * d * 0.6);
  gl_Position = projectionMatrix * view;
}`;
const FRAGMENT = /* glsl */ `
uniform vec3 fog;
varying vec3 vColour;
varying float vFog;
void main() { gl_FragColor = vec4(mix(vColour, fog, vFog), 1.0); }`;

const STAND_IN_VERTEX = /* glsl */ `
uniform vec3 sky, ground;
varying vec3 vColour;
void main() {
  vec3 n = normalize(mat3(instanceMatrix) * normal);
  vColour = vec3(0.72, 0.77, 0.82) * mix(ground, sky, n.z * 0.5 + 0.5);
  gl_Position = projectionMatrix * viewMatrix * instanceMatrix * vec4(position, 1.0);
}`;
const STAND_IN_FRAGMENT = /* glsl */ `
varying vec3 vColour;
void main() { gl_FragColor = vec4(vColour, 0.6); }`;
/** Lamps of rooms light whoever is in one, not the sun and the sky. */
const INDOORS = insideLight();

/**
 * Light a material by the lamps of rooms, or by sun and sky.
 * @param {import("./light.js").Light} light
 * @param {any} material
 * @param {boolean} indoors
 */
export function lightBy(light, material, indoors) {
  const { uniforms } = material;
  for (const key of /** @type {const} */ (["sun", "sunColour", "sky", "ground", "reach"])) uniforms[key] = indoors ? INDOORS[key] : light[key];
}

/** What stands for somebody whose body is on its way: a shape of their height. @param {import("./light.js").Light} light */
export function standInMaterial(light) {
  const { sun, sunColour, sky, ground, reach } = light;
  return new THREE.ShaderMaterial({ uniforms: { sun, sunColour, sky, ground, reach }, vertexShader: STAND_IN_VERTEX, fragmentShader: STAND_IN_FRAGMENT, transparent: true });
}

/**
 * @param {import("./light.js").Light} light
 * @param {any} bones everybody's, a row each
 * @param {number} row theirs
 */
export function personMaterial(light, bones, row) {
  return shadedMaterial(light, {
    uniforms: { ...lightUniforms(light), bones: { value: bones }, row: { value: row }, lamp: { value: 0 } },
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    side: THREE.DoubleSide,
  });
}
