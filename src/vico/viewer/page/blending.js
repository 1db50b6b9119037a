// From one motion into the next: joints turn over, feet step from where they stand to where they are needed.
// The rules are those of vico.sim.animation.clips, on level ground.

import { clamp, compose, cross, dot, fraction, inverse, minus, ofAxes, partWay, rotate, smoothstep, turnBack, unit } from "./rotations.js";

/** @typedef {import("./skeleton.js").PersonFile} PersonFile */
/** @typedef {import("./skeleton.js").Pose} Pose */
/** @typedef {import("./rotations.js").Vector} Vector */
/** @typedef {import("./rotations.js").Quaternion} Quaternion */
/** @typedef {{place: Vector, foot: Quaternion}} Foot where an ankle is, and how the foot is turned, body frame */

const HIP = [1, 2];
const KNEE = [4, 5];
const ANKLE = [7, 8];
/** Pitches of a foot, toes down, at which soles are measured, radians. */
const [FIRST_PITCH, PITCH_STEP] = [-0.5, 0.05];
/** A swing of which less than this share is left changes nothing any more. */
const TOO_LATE = 0.4;
const CYCLE = 0.99;
const WALK_DUTY = 0.62;
const [FIRST_UNTIL, SECOND_FROM] = [0.55, 0.45];
const [STEP_LIFT, FULL_STEP] = [0.03, 0.15];

/** @param {Pose} pose @param {number} joint @returns {Quaternion} */
function turnOf(pose, joint) {
  return [...pose.quaternions.subarray(4 * joint, 4 * joint + 4)];
}

/** @param {PersonFile} person @param {number} joint @returns {Vector} in the T-pose */
function jointOf(person, joint) {
  return [...person.joints.subarray(3 * joint, 3 * joint + 3)];
}

/** @param {PersonFile} person @param {Pose} pose @returns {Vector} */
function pelvisOf(person, pose) {
  return jointOf(person, 0).map((x, k) => x + pose.shift[k]);
}

/** @param {PersonFile} person @param {Pose} pose @param {number} side @returns {Foot} */
function footOf(person, pose, side) {
  let place = pelvisOf(person, pose);
  let turned = turnOf(pose, 0);
  let at = 0;
  for (const joint of [HIP[side], KNEE[side], ANKLE[side]]) {
    const away = rotate(turned, minus(jointOf(person, joint), jointOf(person, at)));
    place = place.map((x, k) => x + away[k]);
    turned = compose(turned, turnOf(pose, joint));
    at = joint;
  }
  return { place, foot: turned };
}

/** @param {number[]} table by pitch @param {number} pitch */
function atPitch(table, pitch) {
  const at = Math.min(Math.max((pitch - FIRST_PITCH) / PITCH_STEP, 0), table.length - 1.001);
  const k = Math.floor(at);
  return table[k] + (at - k) * (table[k + 1] - table[k]);
}

/** @param {Quaternion} foot @returns {number} toes down, radians */
function pitchOf(foot) {
  return Math.asin(clamp(-rotate(foot, [1, 0, 0])[2]));
}

/** @param {PersonFile} person @param {number} side @param {Quaternion} foot @returns {Vector} the ankle from where the foot stands flat */
function rollOf(person, side, foot) {
  const [x, y] = rotate(foot, [1, 0, 0]);
  const pitch = pitchOf(foot);
  const ahead = atPitch(person.soles.roll[side], pitch) / Math.sqrt(x * x + y * y + 1e-9);
  return [ahead * x, ahead * y, atPitch(person.soles.depth[side], pitch)];
}

/**
 * Turn every joint a share of the way from where it was to where it is now, and shift the pelvis so.
 * @param {Pose} out changed
 * @param {Pose} before
 * @param {number} share
 */
export function blendJoints(out, before, share) {
  turnBack(before.quaternions, out.quaternions, share);
  for (let k = 0; k < 3; k++) out.shift[k] = before.shift[k] + (out.shift[k] - before.shift[k]) * share;
}

/** @param {PersonFile} person @param {Pose} out @param {number} side @param {Vector} ankle @param {number} stretch */
function highestPelvis(person, out, side, ankle, stretch) {
  const [first, second] = legOf(person, side);
  const length = stretch * (first + second);
  const hip = hipOf(person, out, side);
  const up = Math.sqrt(Math.max(length ** 2 - (ankle[0] - hip[0]) ** 2 - (ankle[1] - hip[1]) ** 2, 0.01));
  return ankle[2] + up - hip[2] + out.shift[2];
}

/** @param {PersonFile} person @param {number} side @returns {[number, number]} lengths of thigh and shin */
function legOf(person, side) {
  const [hip, knee, ankle] = [HIP, KNEE, ANKLE].map((joints) => jointOf(person, joints[side]));
  return [Math.hypot(...minus(knee, hip)), Math.hypot(...minus(ankle, knee))];
}

/** @param {PersonFile} person @param {Pose} out @param {number} side @returns {Vector} */
function hipOf(person, out, side) {
  const away = rotate(turnOf(out, 0), minus(jointOf(person, HIP[side]), jointOf(person, 0)));
  return pelvisOf(person, out).map((x, k) => x + away[k]);
}

/**
 * Bend a limb of two bones to reach a point; one out of reach is approached in its direction.
 * @param {Vector} start @param {Vector} goal metres
 * @param {Vector} pole where the middle joint points to
 * @param {number} first @param {number} second lengths of the bones, metres
 * @returns {{upper: Vector, lower: Vector, hinge: Vector}} directions, and the axis that turns the first into the second
 */
export function twoBones(start, goal, pole, first, second) {
  const way = minus(goal, start);
  const length = Math.hypot(...way);
  const along = way.map((x) => x / Math.max(length, 1e-9));
  const distance = Math.min(Math.max(length, Math.abs(first - second) + 1e-4), (first + second) * 0.9998);
  const lean = dot(pole, along);
  const bent = unit(pole.map((x, k) => x - along[k] * lean));
  const cosine = clamp((first ** 2 + distance ** 2 - second ** 2) / (2 * first * distance));
  const sine = Math.sqrt(1 - cosine ** 2);
  const upper = along.map((x, k) => x * cosine + bent[k] * sine);
  return { upper, lower: unit(along.map((x, k) => x * distance - upper[k] * first)), hinge: unit(cross(bent, along)) };
}

/** @param {PersonFile} person @param {Pose} out @param {number} side @param {Foot} foot */
function bendLeg(person, out, side, { place, foot }) {
  const [ahead, beside] = rotate(foot, [1, 0, 0]);
  const { upper, lower, hinge } = twoBones(hipOf(person, out, side), place, [ahead, beside, 0], ...legOf(person, side));
  const [thigh, shin] = [upper, lower].map((way) => {
    const up = way.map((x) => -x);
    return ofAxes(cross(hinge, up), hinge, up);
  });
  const q = out.quaternions;
  q.set(compose(inverse(turnOf(out, 0)), thigh), 4 * HIP[side]);
  q.set(compose(inverse(thigh), shin), 4 * KNEE[side]);
  q.set(compose(inverse(shin), foot), 4 * ANKLE[side]);
}

/** @param {PersonFile} person @param {Pose} out @param {Foot[]} feet @param {number} share */
function bendLegs(person, out, feet, share) {
  // Legs that are all but straight snap: from as straight as they may have been to a little bent.
  const stretch = 0.9995 - 0.0045 * Math.min(3 * share, 1);
  for (const side of [0, 1]) out.shift[2] = Math.min(out.shift[2], highestPelvis(person, out, side, feet[side].place, stretch));
  for (const side of [0, 1]) bendLeg(person, out, side, feet[side]);
}

/**
 * Blend into a motion off one's feet, or out of it: nothing reaches into the floor.
 * @param {PersonFile} person
 * @param {Pose} out
 * @param {Pose} before
 * @param {number} u how far, 0..1
 */
export function lieDown(person, out, before, u) {
  blendJoints(out, before, smoothstep(u));
  let lowest = 0;
  for (const side of [0, 1]) lowest = Math.min(lowest, footOf(person, out, side).place[2] - atPitch(person.soles.depth[side], 0));
  out.shift[2] -= lowest;
}

/**
 * Blend into standing, sitting or turning: one foot goes where it is needed, then the other one.
 * @param {PersonFile} person
 * @param {Pose} out
 * @param {Pose} before
 * @param {number} turned how far the body has turned to the left since: feet that stand do not
 * @param {number} u how far, 0..1
 */
export function standBySteps(person, out, before, turned, u) {
  const back = [0, 0, Math.sin(-turned / 2), Math.cos(turned / 2)];
  const were = [0, 1].map((side) => footOf(person, before, side)).map(({ place, foot }) => ({ place: rotate(back, place), foot: compose(back, foot) }));
  const to = [0, 1].map((side) => footOf(person, out, side));
  blendJoints(out, before, smoothstep(u));
  // The foot in the air comes down first; of two on the ground that which has farther to go.
  const away = were.map(({ place }, side) => minus(to[side].place, place).reduce((sum, x) => sum + x * x, 0));
  const leftFirst = were[0].place[2] + 0.1 * away[0] > were[1].place[2] + 0.1 * away[1];
  const feet = were.map(({ place, foot }, side) => {
    const own = (side === 0) === leftFirst ? u / FIRST_UNTIL : (u - SECOND_FROM) / (1 - SECOND_FROM);
    const step = smoothstep(own);
    const at = place.map((x, k) => x + (to[side].place[k] - x) * step);
    at[2] += STEP_LIFT * person.height * Math.min(Math.sqrt(away[side]) / FULL_STEP, 1) * Math.sin(Math.PI * step);
    return { place: at, foot: partWay(foot, to[side].foot, step) };
  });
  bendLegs(person, out, feet, u);
}

/**
 * How far a foot has come, 0..1, in the first step that it takes after a place in its cycle.
 * @param {number} was
 * @param {number} now
 * @param {number} duty
 */
function stepTaken(was, now, duty) {
  const gone = now - was;
  let left = was < duty ? duty - was : 0;
  let swing = 1 - Math.max(was, duty);
  if (duty === WALK_DUTY && swing < TOO_LATE * (1 - duty)) {
    // It comes down where it was about to; the next step brings it to its own place, before the cycle is over.
    left = swing + duty;
    swing = Math.min(1 - duty, CYCLE - left);
  }
  return Math.min(Math.max((gone - left) / swing, 0), 1);
}

/**
 * Blend into a gait: a foot on the ground stays where it is, and comes to the gait's own place with its next step.
 * @param {PersonFile} person
 * @param {Pose} out the gait now
 * @param {{old: Pose, start: Pose, level: Pose}} poses the motion before as it would go on, the gait as it began, and
 *   the motion before as it ended
 * @param {{walked: boolean, phaseBefore: number, dutyBefore: number, begun: number, gone: number, duty: number, u: number}} course
 */
export function setOut(person, out, { old, start, level }, { walked, phaseBefore, dutyBefore, begun, gone, duty, u }) {
  const linear = Math.min(u, 1);
  const share = smoothstep(linear);
  const flat = (/** @type {Pose} */ pose, /** @type {number} */ side) => {
    const { place, foot } = footOf(person, pose, side);
    return minus(place, rollOf(person, side, foot));
  };
  const own = [0, 1].map((side) => footOf(person, out, side));
  const were = [0, 1].map((side) => footOf(person, old, side).foot);
  const offs = [0, 1].map((side) => minus(flat(level, side), flat(start, side)));
  blendJoints(out, old, share);
  const feet = own.map(({ place, foot }, side) => {
    const at = fraction(begun + 0.5 * side);
    const flew = walked && fraction(phaseBefore + 0.5 * side) > dutyBefore && at < duty;
    const step = flew ? 1 : stepTaken(at, at + gone, duty);
    const flying = flew ? linear : 1;
    let rest = 1 - smoothstep(step);
    let rise = Math.min(1 - smoothstep(2.5 * step), 1 - share);
    const moved = [...place];
    if (flying < 1) {
      [rest, rise] = [1 - smoothstep(1.4 * flying), 1 - smoothstep(flying)];
      moved[2] += STEP_LIFT * person.height * Math.sin(Math.PI * flying) ** 2;
    }
    const before = rollOf(person, side, foot);
    const turned = partWay(were[side], foot, share);
    const after = rollOf(person, side, turned);
    const ankle = moved.map((x, k) => x - before[k] + after[k] + (k < 2 ? rest : rise) * offs[side][k]);
    ankle[2] = Math.max(ankle[2], atPitch(person.soles.depth[side], pitchOf(turned)));
    return { place: ankle, foot: turned };
  });
  bendLegs(person, out, feet, share);
}
