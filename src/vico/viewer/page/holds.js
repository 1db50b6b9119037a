// Arms that hold something beside what the rest of the body does: umbrella, placard, box before the chest.
// The rules are those of vico.sim.animation.postures; tests hold this module against vico.sim.recording.PosedPeople.

import { twoBones } from "./blending.js";
import { compose, inverse, minus, ofAxes, cross, partWay, smoothstep } from "./rotations.js";
import { forwardKinematics } from "./skeleton.js";

/** @typedef {import("./skeleton.js").PersonFile} PersonFile */
/** @typedef {import("./skeleton.js").Pose} Pose */
/** @typedef {import("./rotations.js").Vector} Vector */
/** @typedef {import("./rotations.js").Quaternion} Quaternion */

/** How something is held, as recordings number it. */
export const HOLD = { nothing: 0, umbrellaLeft: 1, umbrellaRight: 2, beforeChest: 3, placardRight: 4 };
const SHOULDER = [16, 17];
const ELBOW = [18, 19];
const WRIST = [20, 21];
const FIRST_FINGER = [25, 40];
const [FINGERS, THUMB] = [5, 4];
const SIGN = [1, -1];

/** @param {number} axis 0, 1, 2 @param {number} angle radians @returns {Quaternion} */
function about(axis, angle) {
  const q = [0, 0, 0, Math.cos(angle / 2)];
  q[axis] = Math.sin(angle / 2);
  return q;
}

/** @param {Pose} pose @param {number} joint @returns {Quaternion} */
function turnOf(pose, joint) {
  return [...pose.quaternions.subarray(4 * joint, 4 * joint + 4)];
}

/** @param {PersonFile} person @param {number} a @param {number} b @returns {Vector} from one joint of the T-pose to another */
function bone(person, a, b) {
  return minus([...person.joints.subarray(3 * b, 3 * b + 3)], [...person.joints.subarray(3 * a, 3 * a + 3)]);
}

/**
 * Bring a wrist a share of the way to a point that is given from its shoulder, the elbow towards `pole`.
 * @param {PersonFile} person @param {Pose} pose @param {number} side @param {(shoulder: Vector) => Vector} goalFrom
 * @param {Vector} pole @param {number} share
 */
function reachBy(person, pose, side, goalFrom, pole, share) {
  const { placed, turned } = forwardKinematics(person, pose);
  const [shoulder, elbow, wrist] = [SHOULDER[side], ELBOW[side], WRIST[side]];
  const start = [...placed.subarray(3 * shoulder, 3 * shoulder + 3)];
  const parent = person.parents[shoulder];
  const above = [...turned.subarray(4 * parent, 4 * parent + 4)];
  const { upper, lower, hinge } = twoBones(start, goalFrom(start), pole, Math.hypot(...bone(person, shoulder, elbow)), Math.hypot(...bone(person, elbow, wrist)));
  const up = hinge.map((x) => -SIGN[side] * x);
  const [arm, forearm] = [upper, lower].map((way) => {
    const along = way.map((/** @type {number} */ x) => x * SIGN[side]);
    return ofAxes(cross(along, up), along, up);
  });
  const q = pose.quaternions;
  q.set(partWay(turnOf(pose, shoulder), compose(inverse(above), arm), share), 4 * shoulder);
  q.set(partWay(turnOf(pose, elbow), compose(inverse(arm), forearm), share), 4 * elbow);
}

/** Close a hand round something. @param {PersonFile} person @param {Pose} pose @param {number} side @param {number} curl radians */
function grip(person, pose, side, curl) {
  const sign = -SIGN[side];
  for (let finger = 0; finger < FINGERS; finger++) {
    const first = FIRST_FINGER[side] + 3 * finger;
    const along = bone(person, first, first + 1);
    const spread = Math.atan2(along[0], Math.abs(along[1]));
    const [share, bend] = finger < THUMB ? [0.8, curl] : [0.35, 0.6 * curl];
    pose.quaternions.set(compose(about(2, -sign * share * spread), about(0, sign * 0.8 * bend)), 4 * first);
    for (const k of [1, 2]) pose.quaternions.set(about(0, sign * bend), 4 * (first + k));
  }
}

/**
 * Bring the arms from what the motion has them do a share of the way to where they hold something.
 * @param {PersonFile} person
 * @param {Pose} pose changed
 * @param {{hold: number, share: number, width: number}} held how, how far the arms have come (0..1), and how wide it is, metres
 */
export function holdUp(person, pose, { hold, share, width }) {
  if (hold === HOLD.nothing || share <= 0) return;
  const part = smoothstep(share);
  const tall = person.height;
  const sides = hold === HOLD.beforeChest ? [0, 1] : [hold === HOLD.umbrellaLeft ? 0 : 1];
  for (const side of sides) {
    const sign = SIGN[side];
    const wrist = turnOf(pose, WRIST[side]);
    if (hold === HOLD.beforeChest) {
      const apart = Math.min(Math.max(0.5 * width, 0.06 * tall), 0.16 * tall);
      reachBy(person, pose, side, ([x, , z]) => [x + 0.17 * tall, sign * apart, z - 0.21 * tall], [-0.6, sign, -0.8], part);
      pose.quaternions.set(partWay(wrist, about(2, -sign * 0.35), part), 4 * WRIST[side]);
      grip(person, pose, side, 0.3);
    } else {
      reachBy(person, pose, side, ([x, y, z]) => [x + 0.135 * tall, y - sign * 0.02 * tall, z - 0.12 * tall], [-0.5, sign * 0.5, -1], part);
      pose.quaternions.set(partWay(wrist, [0, 0, 0, 1], part), 4 * WRIST[side]);
      grip(person, pose, side, 0.38 + 0.62 * part);
    }
  }
}

/**
 * What somebody holds up between two steps.
 * @param {any} before table of people @param {number} row
 * @param {any} after @param {number | undefined} other its row there
 * @param {number} part of the way between the steps
 * @returns {{hold: number, share: number}}
 */
export function heldAt(before, row, after, other, part) {
  const from = { hold: before.hold[row], share: before.hold_share[row] / 100 };
  if (other === undefined) return from;
  const to = { hold: after.hold[other], share: after.hold_share[other] / 100 };
  if (to.hold === from.hold) return { hold: from.hold, share: from.share + (to.share - from.share) * part };
  // It comes up from nothing, or goes down to it.
  return to.hold === HOLD.nothing ? { hold: from.hold, share: from.share * (1 - part) } : { hold: to.hold, share: to.share * part };
}
