// A person's body: joints, meshes, tables of motions, and where joints are in a pose.

export const JOINTS = 55;

/** A person's file, as vico.viewer.city.people lays it out. */
export class PersonFile {
  /** @param {ArrayBuffer} buffer */
  constructor(buffer) {
    const length = new DataView(buffer).getUint32(0, true);
    /** @type {any} */
    this.head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    this.buffer = buffer;
    this.base = 4 + length;
    const floats = (/** @type {number} */ at, /** @type {number} */ n) => new Float32Array(buffer, this.base + at, n);
    const [rest, joints, frames] = this.head.skeleton;
    this.rest = floats(rest, 3 * JOINTS);
    this.joints = floats(joints, 3 * JOINTS);
    this.frames = quaternionsOf(floats(frames, 9 * JOINTS));
    this.parents = this.head.parents;
    const [quaternions, shifts, resting] = this.head.motion_data;
    const rows = (shifts - quaternions) / (8 * JOINTS);
    this.quaternions = new Int16Array(buffer, this.base + quaternions, rows * 4 * JOINTS);
    this.shifts = floats(shifts, rows * 3);
    const count = this.head.motions.filter((/** @type {any} */ m) => m.resting !== undefined).length;
    this.resting = floats(resting, count * 4 * 56 * 3);
    this.height = this.head.height;
    /** Of the left and the right sole by the foot's pitch: how far below the ankle, and how far it rolls on, metres. */
    this.soles = this.head.soles;
  }

  /**
   * The columns of a mesh.
   * @param {number} level 0 near, 1 far
   */
  mesh(level) {
    const { vertices: n, indices, columns } = this.head.meshes[level];
    const at = (/** @type {number} */ k) => this.base + columns[k];
    return {
      position: new Float32Array(this.buffer, at(0), 3 * n),
      normal: new Float32Array(this.buffer, at(1), 3 * n),
      colour: new Uint8Array(this.buffer, at(2), 4 * n),
      joints: new Uint8Array(this.buffer, at(3), 4 * n),
      weights: new Uint8Array(this.buffer, at(4), 4 * n),
      index: new Uint16Array(this.buffer, at(5), indices),
    };
  }
}

/** How somebody holds themselves: rotations of the joints relative to their parents, and the pelvis' shift. */
export class Pose {
  constructor() {
    this.quaternions = new Float32Array(4 * JOINTS);
    this.shift = new Float32Array(3);
  }
}

const turned = new Float32Array(4 * JOINTS);
const placed = new Float32Array(3 * JOINTS);

/**
 * Write the matrices that bring a body's vertices from rest to a pose: three rows of four numbers a joint.
 * @param {PersonFile} person
 * @param {Pose} pose
 * @param {Float32Array} out
 * @param {number} start
 */
export function writeBones(person, pose, out, start) {
  forwardKinematics(person, pose);
  const { rest, frames } = person;
  for (let j = 0; j < JOINTS; j++) {
    const i = 4 * j;
    const ax = turned[i], ay = turned[i + 1], az = turned[i + 2], aw = turned[i + 3];
    const bx = frames[i], by = frames[i + 1], bz = frames[i + 2], bw = frames[i + 3];
    const x = aw * bx + ax * bw + ay * bz - az * by;
    const y = aw * by - ax * bz + ay * bw + az * bx;
    const z = aw * bz + ax * by - ay * bx + az * bw;
    const w = aw * bw - ax * bx - ay * by - az * bz;
    const o = start + 12 * j;
    const m00 = 1 - 2 * (y * y + z * z), m01 = 2 * (x * y - w * z), m02 = 2 * (x * z + w * y);
    const m10 = 2 * (x * y + w * z), m11 = 1 - 2 * (x * x + z * z), m12 = 2 * (y * z - w * x);
    const m20 = 2 * (x * z - w * y), m21 = 2 * (y * z + w * x), m22 = 1 - 2 * (x * x + y * y);
    const rx = rest[3 * j], ry = rest[3 * j + 1], rz = rest[3 * j + 2];
    out[o] = m00; out[o + 1] = m01; out[o + 2] = m02;
    out[o + 3] = placed[3 * j] - (m00 * rx + m01 * ry + m02 * rz);
    out[o + 4] = m10; out[o + 5] = m11; out[o + 6] = m12;
    out[o + 7] = placed[3 * j + 1] - (m10 * rx + m11 * ry + m12 * rz);
    out[o + 8] = m20; out[o + 9] = m21; out[o + 10] = m22;
    out[o + 11] = placed[3 * j + 2] - (m20 * rx + m21 * ry + m22 * rz);
  }
}

/**
 * Write where all joints are, and how they are turned, in the body's frame.
 * @param {PersonFile} person
 * @param {Pose} pose
 * @returns {{turned: Float32Array, placed: Float32Array}} used again at the next call
 */
export function forwardKinematics(person, pose) {
  const { joints, parents } = person;
  const q = pose.quaternions;
  for (let j = 0; j < JOINTS; j++) {
    const i = 4 * j;
    const p = parents[j];
    if (p < 0) {
      turned.set(q.subarray(0, 4));
      for (let k = 0; k < 3; k++) placed[k] = joints[k] + pose.shift[k];
      continue;
    }
    const ax = turned[4 * p], ay = turned[4 * p + 1], az = turned[4 * p + 2], aw = turned[4 * p + 3];
    const bx = q[i], by = q[i + 1], bz = q[i + 2], bw = q[i + 3];
    turned[i] = aw * bx + ax * bw + ay * bz - az * by;
    turned[i + 1] = aw * by - ax * bz + ay * bw + az * bx;
    turned[i + 2] = aw * bz + ax * by - ay * bx + az * bw;
    turned[i + 3] = aw * bw - ax * bx - ay * by - az * bz;
    const dx = joints[3 * j] - joints[3 * p], dy = joints[3 * j + 1] - joints[3 * p + 1], dz = joints[3 * j + 2] - joints[3 * p + 2];
    // v + 2 w (u x v) + 2 u x (u x v)
    const cx = ay * dz - az * dy, cy = az * dx - ax * dz, cz = ax * dy - ay * dx;
    placed[3 * j] = placed[3 * p] + dx + 2 * (aw * cx + ay * cz - az * cy);
    placed[3 * j + 1] = placed[3 * p + 1] + dy + 2 * (aw * cy + az * cx - ax * cz);
    placed[3 * j + 2] = placed[3 * p + 2] + dz + 2 * (aw * cz + ax * cy - ay * cx);
  }
  return { turned, placed };
}

/** @param {Float32Array} matrices rows of 3 x 3 @returns {Float32Array} quaternions x, y, z, w */
function quaternionsOf(matrices) {
  const count = matrices.length / 9;
  const out = new Float32Array(4 * count);
  for (let k = 0; k < count; k++) {
    const m = matrices.subarray(9 * k, 9 * k + 9);
    const trace = m[0] + m[4] + m[8];
    let x, y, z, w;
    if (trace > 0) {
      const s = 2 * Math.sqrt(trace + 1);
      [w, x, y, z] = [s / 4, (m[7] - m[5]) / s, (m[2] - m[6]) / s, (m[3] - m[1]) / s];
    } else if (m[0] > m[4] && m[0] > m[8]) {
      const s = 2 * Math.sqrt(1 + m[0] - m[4] - m[8]);
      [w, x, y, z] = [(m[7] - m[5]) / s, s / 4, (m[1] + m[3]) / s, (m[2] + m[6]) / s];
    } else if (m[4] > m[8]) {
      const s = 2 * Math.sqrt(1 + m[4] - m[0] - m[8]);
      [w, x, y, z] = [(m[2] - m[6]) / s, (m[1] + m[3]) / s, s / 4, (m[5] + m[7]) / s];
    } else {
      const s = 2 * Math.sqrt(1 + m[8] - m[0] - m[4]);
      [w, x, y, z] = [(m[3] - m[1]) / s, (m[2] + m[6]) / s, (m[5] + m[7]) / s, s / 4];
    }
    out.set([x, y, z, w], 4 * k);
  }
  return out;
}
