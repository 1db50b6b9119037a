// The light of a moment, as numbers that all materials share.

import { THREE } from "./three.js";

/** @typedef {{value: any}} Uniform */

/**
 * @typedef {object} Light
 * @property {Uniform} sun unit vector to the sun (or the moon)
 * @property {Uniform} sunColour
 * @property {Uniform} sky colour of the light from above
 * @property {Uniform} ground colour of the light from below
 * @property {Uniform} fog its colour
 * @property {Uniform} reach metres after which a third is left to see
 * @property {Uniform} night 0 by day, 1 at night: how much windows and lamps show
 * @property {Uniform} snow share of level ground that is white
 * @property {Uniform} wet
 * @property {Uniform} time seconds
 * @property {Uniform} zenith
 * @property {Uniform} horizon
 * @property {Uniform} clouds
 * @property {Uniform} shade heights to which buildings' shadows reach, seen from above
 * @property {Uniform} shadeFrame how a place is found in it: scale, shift east and north, its lowest height
 * @property {Set<any>} receivers materials that shadows fall on
 * @property {boolean} shaded whether they do
 */

/** @returns {Light} */
export function makeLight() {
  const colour = (/** @type {number[]} */ [r, g, b]) => ({ value: new THREE.Color(r, g, b) });
  return {
    sun: { value: new THREE.Vector3(0.4, -0.5, 0.77) },
    sunColour: colour([0.62, 0.58, 0.5]),
    sky: colour([0.5, 0.55, 0.63]),
    ground: colour([0.34, 0.33, 0.31]),
    fog: colour([0.74, 0.8, 0.86]),
    reach: { value: 1500 },
    night: { value: 0 },
    snow: { value: 0 },
    wet: { value: 0 },
    time: { value: 0 },
    zenith: colour([0.3, 0.5, 0.78]),
    horizon: colour([0.74, 0.81, 0.88]),
    clouds: { value: 0.3 },
    shade: { value: null },
    shadeFrame: { value: new THREE.Vector4() },
    receivers: new Set(),
    shaded: false,
  };
}

/** @param {number} x @param {number} a @param {number} b @returns {number} */
function ramp(x, a, b) {
  const t = Math.min(Math.max((x - a) / (b - a), 0), 1);
  return t * t * (3 - 2 * t);
}

/** @param {number[]} a @param {number[]} b @param {number} t @returns {number[]} */
function mix(a, b, t) {
  return a.map((v, k) => v + (b[k] - v) * t);
}

/**
 * Set the light to a frame's sky.
 * @param {Light} light
 * @param {Float32Array} sky as docs/viewer_protocol.md has it
 */
export function setLight(light, sky) {
  const known = Number.isFinite(sky[0]);
  const up = known ? sky[2] : 0.7;
  const clouds = Number.isFinite(sky[4]) ? sky[4] : 0.3;
  const falling = Math.min(1, (finite(sky[5], 0) + 2 * finite(sky[6], 0)) / 6);
  const grey = Math.min(1, Math.max(clouds * clouds, falling));
  const day = ramp(up, -0.14, 0.12);
  const gold = ramp(up, -0.1, 0.02) * (1 - ramp(up, 0.05, 0.35)) * (1 - grey);
  light.sun.value.set(known ? sky[0] : 0.4, known ? sky[1] : -0.5, up);
  if (up < -0.05) light.sun.value.set(0.3, 0.4, 0.87);
  const strength = ramp(up, -0.03, 0.25) * (1 - 0.85 * grey);
  set(light.sunColour, mix([0.03, 0.035, 0.05], mix([0.63, 0.59, 0.51], [0.75, 0.45, 0.2], gold), strength));
  // What lies in the shade of a house is lit by the sky and by the houses across the street.
  set(light.sky, mix([0.15, 0.155, 0.2], mix([0.57, 0.62, 0.69], [0.67, 0.67, 0.67], grey), day));
  set(light.ground, mix([0.13, 0.115, 0.1], [0.41, 0.4, 0.38], day));
  const zenith = mix([0.015, 0.02, 0.05], mix([0.25, 0.47, 0.78], [0.58, 0.61, 0.65], grey), day);
  let horizon = mix([0.05, 0.055, 0.09], mix([0.72, 0.8, 0.88], [0.7, 0.72, 0.74], grey), day);
  horizon = mix(horizon, [0.95, 0.62, 0.38], 0.7 * gold);
  set(light.zenith, zenith);
  set(light.horizon, horizon);
  set(light.fog, horizon);
  light.clouds.value = clouds;
  light.night.value = Number.isFinite(sky[3]) ? sky[3] : 1 - day;
  light.night.value *= finite(sky[14], 1);
  light.reach.value = Math.min(finite(sky[7], 6000), 6000) * 0.45;
  light.snow.value = finite(sky[12], 0);
  light.wet.value = finite(sky[11], 0);
}

/** @param {number} value @param {number} otherwise */
function finite(value, otherwise) {
  return Number.isFinite(value) ? value : otherwise;
}

/** @param {Uniform} uniform @param {number[]} rgb */
function set(uniform, [r, g, b]) {
  uniform.value.setRGB(r, g, b);
}
