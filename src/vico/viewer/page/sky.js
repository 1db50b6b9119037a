// Sky, sun, stars, clouds, rain and snow.

import { THREE } from "./three.js";

const SKY_COLOUR = /* glsl */ `
uniform vec3 zenith, horizon, sun, sunColour, fog;
uniform float night, clouds, time, reach;
float hash(vec2 p) { return fract(sin(dot(p, vec2(12.9898, 78.233))) * 43758.5453); }
float noise(vec2 p) {
  vec2 i = floor(p), f = fract(p);
  f = f * f * (3.0 - 2.0 * f);
  return mix(mix(hash(i), hash(i + vec2(1, 0)), f.x), mix(hash(i + vec2(0, 1)), hash(i + vec2(1, 1)), f.x), f.y);
}
vec3 clear(vec3 way) {
  float near = max(dot(way, sun), 0.0);
  return mix(horizon, zenith, sqrt(max(way.z, 0.0))) + sunColour * 0.25 * pow(near, 24.0) * (1.0 - clouds * clouds);
}
// In fog there is no sky to see.
vec3 behindFog(vec3 colour) { return mix(fog, colour, smoothstep(150.0, 1300.0, reach)); }
`;
const DOME_VERTEX = /* glsl */ `
#ifdef PLAIN
varying vec3 vColour;
${SKY_COLOUR}
#else
varying vec3 vWay;
#endif
void main() {
  #ifdef PLAIN
  vec3 colour = clear(position);
  vColour = behindFog(mix(colour, horizon, clouds * 0.35));
  #else
  vWay = position;
  #endif
  vec4 at = projectionMatrix * mat4(mat3(viewMatrix)) * vec4(position, 1.0);
  gl_Position = at.xyww;
}`;
// Clouds and stars are worth their pixels where a graphics card paints them, and in a picture that rests.
const DOME_FRAGMENT = /* glsl */ `
#ifdef PLAIN
varying vec3 vColour;
void main() { gl_FragColor = vec4(vColour, 1.0); }
#else
varying vec3 vWay;
${SKY_COLOUR}
void main() {
  vec3 way = normalize(vWay);
  float up = max(way.z, 0.0);
  vec3 colour = clear(way);
  colour += sunColour * 1.6 * smoothstep(0.9992, 0.9996, dot(way, sun)) * (1.0 - clouds * clouds);
  if (up > 0.02) {
    vec2 plane = way.xy / (up + 0.12) * 1.6 + time * 0.002;
    float puff = noise(plane) * 0.55 + noise(plane * 2.3) * 0.3 + noise(plane * 5.1) * 0.15;
    float cover = smoothstep(0.85 - 0.75 * clouds, 1.05 - 0.55 * clouds, puff) * smoothstep(0.02, 0.2, up);
    colour = mix(colour, mix(horizon * 1.08, vec3(1.0), 0.35 * (1.0 - night)), cover * 0.75);
    vec2 cell = floor(way.xy / (up + 0.4) * 220.0);
    float star = step(0.9965, hash(cell)) * (1.0 - cover) * smoothstep(0.5, 1.0, night);
    colour += star * 0.7 * hash(cell + 3.0);
  }
  gl_FragColor = vec4(behindFog(colour), 1.0);
}
#endif`;

/** Rings of the dome, degrees above the horizon: close where colours change fast. */
const RINGS = [-90, -8, 0, 0.7, 1.6, 3, 5, 8, 12, 18, 26, 36, 48, 62, 76, 90];
const AROUND = 30;

/** @returns {any} a sphere of unit vectors, z up */
function domeGeometry() {
  /** @type {number[]} */
  const position = [];
  /** @type {number[]} */
  const index = [];
  RINGS.forEach((degrees, ring) => {
    const [flat, up] = [Math.cos((degrees * Math.PI) / 180), Math.sin((degrees * Math.PI) / 180)];
    for (let k = 0; k <= AROUND; k++) {
      const angle = (2 * Math.PI * k) / AROUND;
      position.push(Math.cos(angle) * flat, Math.sin(angle) * flat, up);
      const v = ring * (AROUND + 1) + k;
      if (ring && k) index.push(v - 1, v, v - AROUND - 1, v - 1, v - AROUND - 1, v - AROUND - 2);
    }
  });
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(position), 3));
  geometry.setIndex(index);
  return geometry;
}

const FALL_VERTEX = /* glsl */ `
attribute vec3 seed;
uniform float time, speed, box, share;
uniform vec3 eye, drift;
varying float vShown;
void main() {
  vec3 fallen = seed * box + (drift - vec3(0, 0, speed)) * time;
  vec3 at = mod(fallen - eye, box) - 0.5 * box + eye;
  at += position * (vec3(0, 0, 1) - drift / max(speed, 0.1));
  vShown = step(seed.x * 0.37 + seed.y * 0.63, share);
  gl_Position = projectionMatrix * viewMatrix * vec4(at, 1.0);
  gl_PointSize = 2.5;
}`;
const FALL_FRAGMENT = /* glsl */ `
uniform vec3 colour;
uniform float opacity;
varying float vShown;
void main() {
  if (vShown < 0.5) discard;
  gl_FragColor = vec4(colour, opacity);
}`;

const DROPS = 1400;
const BOX = 26;

export class Sky {
  /** @param {any} scene @param {import("./light.js").Light} light */
  constructor(scene, light) {
    const { zenith, horizon, sun, sunColour, night, clouds, time, fog, reach } = light;
    this.light = light;
    this.material = new THREE.ShaderMaterial({
      uniforms: { zenith, horizon, sun, sunColour, night, clouds, time, fog, reach },
      vertexShader: DOME_VERTEX,
      fragmentShader: DOME_FRAGMENT,
      side: THREE.DoubleSide,
      depthWrite: false,
    });
    this.dome = new THREE.Mesh(domeGeometry(), this.material);
    this.dome.frustumCulled = false;
    // Drawn last: only where nothing else is.
    this.dome.renderOrder = 5;
    scene.add(this.dome);
    this.rain = fall(scene, light, { lines: true, speed: 9, opacity: 0.32, colour: [0.78, 0.82, 0.88] });
    this.snow = fall(scene, light, { lines: false, speed: 1.3, opacity: 0.85, colour: [1, 1, 1] });
  }

  /** Paint the sky by vertex, without clouds and stars, or by pixel with them. @param {boolean} plain */
  setPlain(plain) {
    if (plain === Boolean(this.material.defines.PLAIN)) return;
    this.material.defines = plain ? { PLAIN: 1 } : {};
    this.material.needsUpdate = true;
  }

  /**
   * @param {Float32Array} sky
   * @param {any} camera
   * @param {boolean} indoors
   */
  update(sky, camera, indoors) {
    const wind = Number.isFinite(sky[8]) ? sky[8] : 0;
    const from = ((Number.isFinite(sky[9]) ? sky[9] : 0) * Math.PI) / 180;
    for (const [fallen, amount, full] of [[this.rain, sky[5], 5], [this.snow, sky[6], 2.5]]) {
      const share = Number.isFinite(amount) && !indoors ? Math.min(1, Math.sqrt(amount / full)) : 0;
      fallen.visible = share > 0.01;
      fallen.material.uniforms.share.value = share;
      fallen.material.uniforms.eye.value.copy(camera.position);
      fallen.material.uniforms.drift.value.set(-Math.sin(from) * wind * 0.5, -Math.cos(from) * wind * 0.5, 0);
    }
  }
}

/** @param {any} scene @param {any} light @param {any} what @returns {any} */
function fall(scene, light, what) {
  const each = what.lines ? 2 : 1;
  const seed = new Float32Array(3 * DROPS * each);
  const position = new Float32Array(3 * DROPS * each);
  let state = 12345;
  const random = () => (state = (state * 1103515245 + 12345) % 2147483648) / 2147483648;
  for (let k = 0; k < DROPS; k++) {
    const own = [random(), random(), random()];
    for (let e = 0; e < each; e++) {
      seed.set(own, 3 * (k * each + e));
      position[3 * (k * each + e) + 2] = e * 0.45;
      position[3 * (k * each + e)] = e * 0.45;
      position[3 * (k * each + e) + 1] = e * 0.45;
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("seed", new THREE.BufferAttribute(seed, 3));
  const material = new THREE.ShaderMaterial({
    uniforms: {
      time: light.time,
      speed: { value: what.speed },
      box: { value: BOX },
      share: { value: 0 },
      eye: { value: new THREE.Vector3() },
      drift: { value: new THREE.Vector3() },
      colour: { value: new THREE.Color(...what.colour) },
      opacity: { value: what.opacity },
    },
    vertexShader: FALL_VERTEX,
    fragmentShader: FALL_FRAGMENT,
    transparent: true,
    depthWrite: false,
  });
  const found = what.lines ? new THREE.LineSegments(geometry, material) : new THREE.Points(geometry, material);
  found.frustumCulled = false;
  found.visible = false;
  found.renderOrder = 6;
  scene.add(found);
  return found;
}
