// What stands in numbers: of each shape one call near and one far, for those that are in view.

import { THREE } from "./three.js";

/** Shapes smaller than this share of their distance are not drawn. */
const SMALLEST = 0.008;

export class Instances {
  /**
   * @param {any} parent
   * @param {import("./city.js").City} city
   * @param {{near: number, far: number}} [reach] metres
   * @param {any[]} [materials] by texture array
   */
  constructor(parent, city, reach = { near: 45, far: 420 }, materials = city.instancedMaterials) {
    this.parent = parent;
    this.materials = materials;
    this._hidden = false;
    this.city = city;
    this.reach = reach;
    /** @type {any[]} */
    this.sets = [];
    this._last = new THREE.Matrix4();
    this._frustum = new THREE.Frustum();
    this._sphere = new THREE.Sphere();
  }

  /**
   * @param {{prototype: string, offset: number, count: number}} entry
   * @param {ArrayBuffer} buffer
   */
  add(entry, buffer) {
    const model = this.city.models.get(entry.prototype);
    if (!model) return;
    const table = new Float32Array(buffer, entry.offset, 5 * entry.count);
    const size = Math.hypot(model.high[0] - model.low[0], model.high[1] - model.low[1], model.high[2] - model.low[2]);
    const set = { name: entry.prototype, table, count: entry.count, size, seen: seenOf(model), middle: (model.low[2] + model.high[2]) / 2, levels: /** @type {any[]} */ ([]) };
    for (const parts of [model.near, model.far]) {
      set.levels.push(parts.map((/** @type {any} */ part) => this._mesh(part, entry.count)));
    }
    this.sets.push(set);
  }

  /** @param {any} part @param {number} count */
  _mesh(part, count) {
    const mesh = new THREE.InstancedMesh(part.geometry, this.materials[part.array], count);
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = false;
    mesh.count = 0;
    this.parent.add(mesh);
    return mesh;
  }

  /** Draw all of them from near, wherever the camera is. */
  fillAll() {
    for (const set of this.sets) {
      for (const mesh of set.levels[0]) {
        for (let k = 0; k < set.count; k++) placeAt(mesh.instanceMatrix.array, k, set.table, 5 * k);
        mesh.count = set.count;
      }
    }
  }

  /** @param {{near: number, far: number}} reach */
  setReach(reach) {
    if (reach.near === this.reach.near && reach.far === this.reach.far) return;
    this.reach = reach;
    this._last.identity();
  }

  /** @param {any} camera @param {boolean} [hidden] whether nothing is to be seen */
  update(camera, hidden = false) {
    const now = camera.matrixWorldInverse;
    if (hidden !== this._hidden) {
      this._hidden = hidden;
      this._last.identity();
      for (const set of this.sets) for (const level of set.levels) show(level, 0);
    }
    if (hidden || closeTo(this._last, now)) return;
    this._last.copy(now);
    const both = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    this._frustum.setFromProjectionMatrix(both);
    const eye = camera.position;
    for (const set of this.sets) this._fill(set, eye);
  }

  /** @param {any} set @param {any} eye */
  _fill(set, eye) {
    const [near, far] = set.levels;
    let nearCount = 0;
    let farCount = 0;
    const nearest = this.reach.near * (set.size > 3 ? 1.4 : 1);
    const farthest = Math.min(this.reach.far * (set.seen > 3 ? 2.2 : 1), set.seen / SMALLEST);
    const { table } = set;
    for (let k = 0; k < set.count; k++) {
      const at = 5 * k;
      const dx = table[at] - eye.x;
      const dy = table[at + 1] - eye.y;
      const dz = table[at + 2] - eye.z;
      const away = dx * dx + dy * dy + dz * dz;
      if (away > farthest * farthest) continue;
      this._sphere.center.set(table[at], table[at + 1], table[at + 2] + set.middle * table[at + 4]);
      this._sphere.radius = 0.6 * set.size * table[at + 4] + 1;
      if (!this._frustum.intersectsSphere(this._sphere)) continue;
      if (away < nearest * nearest) {
        for (const mesh of near) placeAt(mesh.instanceMatrix.array, nearCount, table, at);
        nearCount++;
      } else {
        for (const mesh of far) placeAt(mesh.instanceMatrix.array, farCount, table, at);
        farCount++;
      }
    }
    show(near, nearCount);
    show(far, farCount);
  }
}

/** @param {any} model @returns {number} how large a shape looks, metres: a pole is tall and hardly seen */
function seenOf({ low, high }) {
  const wide = Math.hypot(high[0] - low[0], high[1] - low[1]);
  return Math.sqrt(Math.max(wide, 0.05) * Math.max(high[2] - low[2], 0.05));
}

/** @param {any[]} meshes @param {number} count */
function show(meshes, count) {
  for (const mesh of meshes) {
    mesh.count = count;
    mesh.visible = count > 0;
    if (count) mesh.instanceMatrix.needsUpdate = true;
  }
}

/** @param {any} a @param {any} b */
function closeTo(a, b) {
  for (let k = 0; k < 16; k++) {
    if (Math.abs(a.elements[k] - b.elements[k]) > (k > 11 ? 0.5 : 0.008)) return false;
  }
  return true;
}

/** @param {Float32Array} out @param {number} row @param {Float32Array} table @param {number} at */
function placeAt(out, row, table, at) {
  const s = table[at + 4];
  const c = Math.cos(table[at + 3]) * s;
  const n = Math.sin(table[at + 3]) * s;
  const o = 16 * row;
  out[o] = c; out[o + 1] = n; out[o + 2] = 0; out[o + 3] = 0;
  out[o + 4] = -n; out[o + 5] = c; out[o + 6] = 0; out[o + 7] = 0;
  out[o + 8] = 0; out[o + 9] = 0; out[o + 10] = s; out[o + 11] = 0;
  out[o + 12] = table[at]; out[o + 13] = table[at + 1]; out[o + 14] = table[at + 2]; out[o + 15] = 1;
}
