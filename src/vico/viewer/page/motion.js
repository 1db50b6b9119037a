// How somebody moves: joint rotations from tables by motion, phase and pace, and from one motion into the next.
// The rules are those of vico.sim.animation; tests hold this module against vico.sim.recording.PosedPeople.

import { blendJoints, lieDown, setOut, standBySteps } from "./blending.js";
import { smoothstep } from "./rotations.js";
import { JOINTS, Pose } from "./skeleton.js";

/** Longest that one motion shows in the next, seconds. */
export const LONGEST_BLEND = 1.3;
const INTO_GAIT = 0.3;
const OUT_OF_GAIT = 0.5;
const DOWN_OR_UP = 0.9;
const OTHERWISE = 0.45;
const TURN_OF_CRANKS = 4.0;
const SLOWEST = 0.15;
const GAITS = new Set(["walk", "run", "carry", "carry_left", "carry_right"]);
const OFF_THEIR_FEET = new Set(["sleep", "ride_bike", "ride_bus"]);
const [WALK_DUTY, RUN_DUTY] = [0.62, 0.36];
const [TURN_CYCLE, TURN_START] = [(2 * Math.PI) / 3, 0.25];
const SEATED = new Set(["sit", "sit_talk", "sit_wave", "sit_drink", "sit_eat"]);

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

const other = new Pose();
const start = new Pose();
const level = new Pose();

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
 * @param {import("./skeleton.js").PersonFile} person
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
  if (isGait(now)) {
    const gone = (motion.since * motion.pace) / strideOf(now, motion.pace, person.height);
    if (gone >= 1 || OFF_THEIR_FEET.has(before)) return;
    const begun = motion.phase - gone;
    const walked = isGait(before);
    poseIn(person, motion.clip, begun, motion.pace, second, start);
    poseIn(person, motion.clipBefore, motion.phaseBefore, motion.paceBefore, second, level);
    // Who goes from one gait to another goes on with the strides of before.
    poseIn(person, motion.clipBefore, motion.phaseBefore + (walked ? gone : 0), motion.paceBefore, second, other);
    setOut(person, out, { old: other, start, level }, { walked, phaseBefore: motion.phaseBefore, dutyBefore: dutyOf(before), begun, gone, duty: dutyOf(now), u });
    return;
  }
  if (u >= 1) return;
  poseIn(person, motion.clipBefore, motion.phaseBefore, motion.paceBefore, second, other);
  if (OFF_THEIR_FEET.has(before) || OFF_THEIR_FEET.has(now)) lieDown(person, out, other, u);
  else standBySteps(person, out, other, now === "turn" ? turnedBy(motion.phase) : 0, u);
}

/** @param {string} name @returns {number} the share of a gait's cycle that a foot is on the ground */
function dutyOf(name) {
  return name === "run" ? RUN_DUTY : WALK_DUTY;
}

/** @param {number} phase of a turn @returns {number} how far the body has turned to the left since it began, radians */
function turnedBy(phase) {
  const gone = phase - TURN_START + 0.5;
  return (gone - Math.floor(gone) - 0.5) * TURN_CYCLE;
}

/**
 * Pose somebody in one motion.
 * @param {import("./skeleton.js").PersonFile} person
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
    blendJoints(faster, out, share);
    out.quaternions.set(faster.quaternions);
    out.shift.set(faster.shift);
  }
}

const faster = new Pose();

/**
 * Bring the phone up in the first of the cycle, and down in the last.
 * @param {import("./skeleton.js").PersonFile} person
 * @param {number} phase
 * @param {number} second
 * @param {Pose} out with the phone raised
 */
function raise(person, phase, second, out) {
  const p = phase - Math.floor(phase);
  const up = smoothstep(12 * p) * smoothstep(12 * (1 - p));
  if (up >= 1) return;
  poseAtRest(person, person.head.motions[0].resting, second, faster);
  blendJoints(out, faster, up);
}

/**
 * @param {import("./skeleton.js").PersonFile} person
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
 * @param {import("./skeleton.js").PersonFile} person
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
