// The coarse ground of tiles, and the spots of light that lamps cast on it.

import { THREE } from "./three.js";

/**
 * Make the coarse ground of a tile.
 * @param {ArrayBuffer} outlook
 * @param {{offset: number, points: number, step: number}} ground
 * @param {any} entry
 * @param {number} half
 */
export function groundGeometry(outlook, ground, entry, half) {
  const n = ground.points;
  const heights = new Float32Array(outlook, ground.offset + 4 * entry.index * n * n, n * n);
  const position = new Float32Array(3 * n * n);
  const uv = new Float32Array(2 * n * n);
  const facing = new Int8Array(4 * n * n);
  for (let iy = 0; iy < n; iy++) {
    for (let ix = 0; ix < n; ix++) {
      const k = iy * n + ix;
      const x = Math.min(entry.x + ix * ground.step, half);
      const y = Math.min(entry.y + iy * ground.step, half);
      position.set([x, y, heights[k] - 0.12], 3 * k);
      uv.set([(x + half) / (2 * half), (y + half) / (2 * half)], 2 * k);
      facing[4 * k + 2] = 127;
    }
  }
  const index = [];
  for (let iy = 0; iy + 1 < n; iy++) {
    for (let ix = 0; ix + 1 < n; ix++) {
      const a = iy * n + ix;
      index.push(a, a + 1, a + n, a + 1, a + n + 1, a + n);
    }
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
  geometry.setAttribute("uv", new THREE.BufferAttribute(uv, 2));
  geometry.setAttribute("facing", new THREE.BufferAttribute(facing, 4, true));
  geometry.setAttribute("tint", new THREE.BufferAttribute(new Uint8Array(4 * n * n).fill(255), 4, true));
  geometry.setIndex(index);
  return geometry;
}

/**
 * Find the spots that lamps light.
 * @param {import("./city.js").City} city
 * @param {ArrayBuffer} outlook
 * @returns {number[][]} x, y, z and radius of each, metres
 */
export function lampPlaces(city, outlook) {
  const shining = new Set(city.manifest.lamps ?? []);
  const places = [];
  for (const { prototype, offset, count } of city.manifest.instances) {
    if (!shining.has(prototype)) continue;
    const table = new Float32Array(outlook, offset, 5 * count);
    const model = city.models.get(prototype);
    for (let k = 0; k < count; k++) {
      const height = (model?.high[2] ?? 5) * table[5 * k + 4];
      const arm = (model?.high[0] ?? 0) > 0.8 ? model.high[0] * 0.8 : 0;
      const yaw = table[5 * k + 3];
      places.push([table[5 * k] + Math.cos(yaw) * arm, table[5 * k + 1] + Math.sin(yaw) * arm, table[5 * k + 2], Math.min(2.2 * height, 13)]);
    }
  }
  return places;
}

/**
 * @param {import("./city.js").City} city
 * @param {{x: number, y: number}} at
 * @returns {number} how much light of street lamps falls on somebody there, 0..1
 */
export function lampLight(city, at) {
  const night = city.light.night.value;
  if (night < 0.05) return 0;
  let sum = 0;
  for (const [x, y, , r] of city.lamps) {
    const dx = (at.x - x) / r;
    const dy = (at.y - y) / r;
    const away = dx * dx + dy * dy;
    if (away < 1) sum += (1 - Math.sqrt(away)) ** 1.2;
  }
  return Math.min(sum, 1) * night;
}

/**
 * Make the spots of light below lamps: one call for all.
 * @param {number[][]} places as of `lampPlaces`
 * @param {import("./light.js").Light} light
 */
export function lampPools(places, light) {
  if (!places.length) return null;
  const material = new THREE.ShaderMaterial({
    uniforms: { night: light.night },
    vertexShader: `varying vec2 at; void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * instanceMatrix * vec4(position, 1.0); }`,
    fragmentShader: `uniform float night; varying vec2 at; void main() { float r = length(at); if (r > 1.0) discard;
      gl_FragColor = vec4(vec3(1.0, 0.8, 0.52) * 0.55 * night * pow(1.0 - r, 1.6), 1.0); }`,
    transparent: true,
    depthWrite: false,
    blending: THREE.AdditiveBlending,
    polygonOffset: true,
    polygonOffsetFactor: -3,
    polygonOffsetUnits: -6,
  });
  const mesh = new THREE.InstancedMesh(new THREE.CircleGeometry(1, 20), material, places.length);
  places.forEach(([x, y, z, r], k) => mesh.instanceMatrix.array.set([r, 0, 0, 0, 0, r, 0, 0, 0, 0, 1, 0, x, y, z + 0.14, 1], 16 * k));
  mesh.frustumCulled = false;
  mesh.renderOrder = 1;
  return mesh;
}
