// How somebody moves: joint rotations from tables by motion, phase and pace, and from one motion into the next.
// The rules are those of vico.sim.animation; tests hold this module against vico.sim.recording.PosedPeople.

export const JOINTS = 55;
/** Longest that one motion shows in the next, seconds. */
export const LONGEST_BLEND = 1.3;
const INTO_GAIT = 0.3;
const OUT_OF_GAIT = 0.5;
const DOWN_OR_UP = 0.9;
const OTHERWISE = 0.45;
const TURN_OF_CRANKS = 4.0;
const SLOWEST = 0.15;
const GAITS = new Set(["walk", "run", "carry", "carry_left", "carry_right"]);
const SEATED = new Set(["sit", "sit_talk", "sit_wave", "sit_drink", "sit_eat"]);

/** @param {number} t */
export function smoothstep(t) {
  const x = Math.min(Math.max(t, 0), 1);
  return x * x * (3 - 2 * x);
}

/** @param {string} name @returns {boolean} */
export function isGait(name) {
  return GAITS.has(name);
}

/**
 * The metres that one cycle of a motion covers; infinite for those that cover none.
 * @param {string} name
 * @param {number} pace metres a second
 * @param {number} height metres
 */
export function strideOf(name, pace, height) {
  if (name === "run") return height * (0.62 + 0.2 * pace);
  if (GAITS.has(name)) return 0.727 * height * Math.max(pace, SLOWEST) ** 0.45;
  return name === "ride_bike" ? TURN_OF_CRANKS : Infinity;
}

/** @param {string} before @param {string} now @returns {number} seconds */
export function blendTime(before, now) {
  if (SEATED.has(before) !== SEATED.has(now) || before === "sleep" || now === "sleep") return DOWN_OR_UP;
  if (GAITS.has(now)) return INTO_GAIT;
  return GAITS.has(before) ? OUT_OF_GAIT : OTHERWISE;
}

/**
 * A number in -1..1 that rests, and is another one about every so many seconds.
 * @param {number} second
 * @param {number} every
 * @param {number} stream
 * @param {number} rhythm
 */
function whim(second, every, stream, rhythm) {
  const at = second / every + 17 * rhythm;
  const k = Math.floor(at);
  const number = (/** @type {number} */ j) => {
    const wild = Math.sin((k - 1 + j) * 12.9898 + stream * 78.233 + rhythm * 37.719) * 43758.5453;
    return 2 * (wild - Math.floor(wild)) - 1;
  };
  const a = number(0);
  return a + (number(1) - a) * smoothstep(((at - k) * every) / 1.5);
}

/**
 * Where the weight is, where the head turns and how it nods, of who stands and waits.
 * @param {number} second
 * @param {number} asymmetry
 * @param {number} rhythm
 * @returns {[number, number, number]}
 */
export function restlessness(second, asymmetry, rhythm) {
  const weight = whim(second, 6 + 5 * asymmetry, 1, rhythm);
  const look = whim(second, 4 + 3 * rhythm, 2, rhythm);
  const away = 0.9 * (look - 0.35 * Math.min(Math.max(look / 0.35, -1), 1));
  return [weight, away, 0.12 * whim(second, 5.5, 3, rhythm) ** 2];
}

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

const other = new Pose();

/**
 * @typedef {object} Motion
 * @property {number} clip
 * @property {number} phase
 * @property {number} pace
 * @property {number} clipBefore
 * @property {number} phaseBefore
 * @property {number} paceBefore
 * @property {number} since seconds that the present motion has gone on
 */

/**
 * Pose somebody.
 * @param {PersonFile} person
 * @param {Motion} motion
 * @param {number} second of the clock
 * @param {Pose} out
 */
export function poseOf(person, motion, second, out) {
  const names = person.head.motions;
  poseIn(person, motion.clip, motion.phase, motion.pace, second, out);
  if (motion.since >= LONGEST_BLEND) return;
  const before = names[motion.clipBefore]?.name;
  const now = names[motion.clip].name;
  if (before === undefined) return;
  const u = motion.since / blendTime(before, now);
  if (u >= 1) return;
  let phase = motion.phaseBefore;
  if (isGait(before) && isGait(now)) {
    // Who goes from one gait to another goes on with the strides of before.
    const stride = strideOf(now, motion.pace, person.height);
    phase += (motion.since * motion.pace) / stride;
  }
  poseIn(person, motion.clipBefore, phase, motion.paceBefore, second, other);
  mix(other.quaternions, out.quaternions, smoothstep(u));
  for (let k = 0; k < 3; k++) out.shift[k] = other.shift[k] + (out.shift[k] - other.shift[k]) * smoothstep(u);
}

/**
 * Pose somebody in one motion.
 * @param {PersonFile} person
 * @param {number} clip
 * @param {number} phase
 * @param {number} pace
 * @param {number} second
 * @param {Pose} out
 */
function poseIn(person, clip, phase, pace, second, out) {
  const entry = person.head.motions[clip] ?? person.head.motions[0];
  if (entry.resting !== undefined) {
    poseAtRest(person, entry.resting, second, out);
    if (entry.name === "phone") raise(person, phase, second, out);
    return;
  }
  const at = (phase - Math.floor(phase)) * entry.phases;
  const first = Math.floor(at) % entry.phases;
  const next = (first + 1) % entry.phases;
  let low = 0;
  let share = 0;
  const { paces } = entry;
  if (paces.length > 1) {
    while (low < paces.length - 2 && pace > paces[low + 1]) low++;
    share = Math.min(Math.max((pace - paces[low]) / (paces[low + 1] - paces[low]), 0), 1);
  }
  const row = entry.row + low * entry.phases;
  between(person, row + first, row + next, at - Math.floor(at), out);
  if (share > 0) {
    between(person, row + entry.phases + first, row + entry.phases + next, at - Math.floor(at), faster);
    // Towards the faster one: what is `out` now is where it comes from.
    mix(out.quaternions, faster.quaternions, share);
    out.quaternions.set(faster.quaternions);
    for (let k = 0; k < 3; k++) out.shift[k] += (faster.shift[k] - out.shift[k]) * share;
  }
}

const faster = new Pose();

/**
 * Bring the phone up in the first of the cycle, and down in the last.
 * @param {PersonFile} person
 * @param {number} phase
 * @param {number} second
 * @param {Pose} out with the phone raised
 */
function raise(person, phase, second, out) {
  const p = phase - Math.floor(phase);
  const up = smoothstep(12 * p) * smoothstep(12 * (1 - p));
  if (up >= 1) return;
  poseAtRest(person, person.head.motions[0].resting, second, faster);
  mix(faster.quaternions, out.quaternions, up);
  for (let k = 0; k < 3; k++) out.shift[k] = faster.shift[k] + (out.shift[k] - faster.shift[k]) * up;
}

/**
 * @param {PersonFile} person
 * @param {number} a
 * @param {number} b
 * @param {number} t
 * @param {Pose} out
 */
function between(person, a, b, t, out) {
  const { quaternions, shifts } = person;
  const from = 4 * JOINTS * a;
  const to = 4 * JOINTS * b;
  const q = out.quaternions;
  for (let j = 0; j < 4 * JOINTS; j += 4) {
    const x0 = quaternions[from + j], y0 = quaternions[from + j + 1], z0 = quaternions[from + j + 2], w0 = quaternions[from + j + 3];
    let x1 = quaternions[to + j], y1 = quaternions[to + j + 1], z1 = quaternions[to + j + 2], w1 = quaternions[to + j + 3];
    if (x0 * x1 + y0 * y1 + z0 * z1 + w0 * w1 < 0) { x1 = -x1; y1 = -y1; z1 = -z1; w1 = -w1; }
    const x = x0 + (x1 - x0) * t, y = y0 + (y1 - y0) * t, z = z0 + (z1 - z0) * t, w = w0 + (w1 - w0) * t;
    const n = 1 / Math.sqrt(x * x + y * y + z * z + w * w);
    q[j] = x * n; q[j + 1] = y * n; q[j + 2] = z * n; q[j + 3] = w * n;
  }
  for (let k = 0; k < 3; k++) out.shift[k] = shifts[3 * a + k] + (shifts[3 * b + k] - shifts[3 * a + k]) * t;
}

/**
 * @param {PersonFile} person
 * @param {number} which
 * @param {number} second
 * @param {Pose} out
 */
function poseAtRest(person, which, second, out) {
  const { asymmetry, rhythm } = person.head.manner;
  const [weight, away, nod] = restlessness(second, asymmetry, rhythm);
  const c = person.resting;
  const size = 56 * 3;
  const at = which * 4 * size;
  for (let j = 0; j < 56; j++) {
    const k = at + 3 * j;
    const x = c[k] + c[k + size] * weight + c[k + 2 * size] * away + c[k + 3 * size] * nod;
    const y = c[k + 1] + c[k + 1 + size] * weight + c[k + 1 + 2 * size] * away + c[k + 1 + 3 * size] * nod;
    const z = c[k + 2] + c[k + 2 + size] * weight + c[k + 2 + 2 * size] * away + c[k + 2 + 3 * size] * nod;
    if (j === JOINTS) {
      out.shift[0] = x; out.shift[1] = y; out.shift[2] = z;
      continue;
    }
    const angle = Math.sqrt(x * x + y * y + z * z);
    const s = angle > 1e-9 ? Math.sin(angle / 2) / angle : 0.5;
    out.quaternions[4 * j] = x * s;
    out.quaternions[4 * j + 1] = y * s;
    out.quaternions[4 * j + 2] = z * s;
    out.quaternions[4 * j + 3] = Math.cos(angle / 2);
  }
}

/**
 * Turn every rotation of `to` back towards `from`: `share` of the way from there is left.
 * @param {Float32Array} from
 * @param {Float32Array} to changed
 * @param {number} share
 */
function mix(from, to, share) {
  for (let j = 0; j < 4 * JOINTS; j += 4) {
    let x0 = from[j], y0 = from[j + 1], z0 = from[j + 2], w0 = from[j + 3];
    let dot = x0 * to[j] + y0 * to[j + 1] + z0 * to[j + 2] + w0 * to[j + 3];
    if (dot < 0) { x0 = -x0; y0 = -y0; z0 = -z0; w0 = -w0; dot = -dot; }
    let a = 1 - share;
    let b = share;
    if (dot < 0.9995) {
      const angle = Math.acos(Math.min(dot, 1));
      const sine = Math.sin(angle);
      a = Math.sin((1 - share) * angle) / sine;
      b = Math.sin(share * angle) / sine;
    }
    const x = a * x0 + b * to[j], y = a * y0 + b * to[j + 1], z = a * z0 + b * to[j + 2], w = a * w0 + b * to[j + 3];
    const n = 1 / Math.sqrt(x * x + y * y + z * z + w * w);
    to[j] = x * n; to[j + 1] = y * n; to[j + 2] = z * n; to[j + 3] = w * n;
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
