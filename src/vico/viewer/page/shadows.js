// Soft dark spots below what stands on the ground.

import { THREE } from "./three.js";

/** @param {any} scene @param {number} count @returns {any} as many spots */
export function shadowMesh(scene, count) {
  const material = new THREE.ShaderMaterial({
    vertexShader: `varying vec2 at; void main() { at = position.xy; gl_Position = projectionMatrix * modelViewMatrix * instanceMatrix * vec4(position, 1.0); }`,
    fragmentShader: `varying vec2 at; void main() { float d = max(abs(at.x), abs(at.y)); float r = length(at);
      gl_FragColor = vec4(0.0, 0.0, 0.02, 0.42 * (1.0 - smoothstep(0.45, 1.0, mix(r, d, 0.4)))); }`,
    transparent: true,
    depthWrite: false,
    polygonOffset: true,
    polygonOffsetFactor: -2,
    polygonOffsetUnits: -2,
  });
  const mesh = new THREE.InstancedMesh(new THREE.PlaneGeometry(2, 2), material, count);
  mesh.frustumCulled = false;
  mesh.count = 0;
  mesh.renderOrder = 2;
  scene.add(mesh);
  return mesh;
}

/**
 * @param {Float32Array} out
 * @param {number} row
 * @param {number} x
 * @param {number} y
 * @param {number} z
 * @param {number} length half of it
 * @param {number} width half of it
 * @param {number} yaw
 */
export function shadowAt(out, row, x, y, z, length, width, yaw) {
  const c = Math.cos(yaw);
  const s = Math.sin(yaw);
  out.set([c * length, s * length, 0, 0, -s * width, c * width, 0, 0, 0, 0, 1, 0, x, y, z, 1], 16 * row);
}
