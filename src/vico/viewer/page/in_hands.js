// Umbrellas and placards in people's hands, as vico.sim.pictures.hands has them.

import { THREE } from "./three.js";
import { HOLD } from "./holds.js";
import { forwardKinematics } from "./skeleton.js";

/** Made for people so tall, metres; the fist of an umbrella is so far below its canopy. */
const [MADE_FOR, SHAFT] = [1.75, 0.8];
/** Below this share of the way up nothing is in the hand yet. */
const FROM = 0.25;
const WRIST = [20, 21];
const KNUCKLE = [28, 43];

/** @param {number} x @param {number} low @param {number} high */
function within(x, low, high) {
  return Math.min(Math.max(x, low), high);
}

export class InHands {
  /** @param {import("./city.js").City} city */
  constructor(city) {
    this.city = city;
    /** @type {{name: string, matrix: any}[]} what is held in this picture */
    this.shown = [];
  }

  begin() {
    this.shown = [];
  }

  /**
   * @param {any} person
   * @param {import("./skeleton.js").Pose} pose
   * @param {any} body
   * @param {{hold: number, share: number}} held
   * @param {number} row among all people: it chooses the colour
   */
  draw(person, pose, body, { hold, share }, row) {
    const isPlacard = hold === HOLD.placardRight;
    const names = this.city.manifest?.[isPlacard ? "placards" : "umbrellas"] ?? [];
    if (!names.length || hold === HOLD.beforeChest) return;
    const fist = palm(person.file, pose, hold === HOLD.umbrellaLeft ? 0 : 1);
    const size = within(person.file.height / MADE_FOR, 0.65, 1.1);
    const opened = within((share - FROM) / (1 - FROM), 0, 1);
    const matrix = isPlacard ? upright(size * Math.max(opened, 0.05)) : leaning(fist, size, opened);
    matrix.setPosition(fist);
    const placed = new THREE.Matrix4().makeRotationZ(body.yaw).setPosition(body.x, body.y, body.z);
    const number = isPlacard ? Math.floor((row * 5) / 2) : Math.floor((row * 7) / 3);
    this.shown.push({ name: names[number % names.length], matrix: placed.multiply(matrix) });
  }
}

/** @param {any} file @param {any} pose @param {number} side @returns {any} the hollow of a palm, body frame */
function palm(file, pose, side) {
  const { placed, turned } = forwardKinematics(file, pose);
  const [wrist, knuckle] = [WRIST[side], KNUCKLE[side]];
  const down = new THREE.Vector3(0, 0, -0.025).applyQuaternion(new THREE.Quaternion(...turned.subarray(4 * wrist, 4 * wrist + 4)));
  const middle = [0, 1, 2].map((k) => 0.3 * placed[3 * wrist + k] + 0.7 * placed[3 * knuckle + k]);
  return new THREE.Vector3(...middle).add(down);
}

/** @param {number} size */
function upright(size) {
  return new THREE.Matrix4().makeScale(size, size, size);
}

/** An umbrella's canopy is above the head, and opens when the arm is half up. @param {any} fist @param {number} size @param {number} opened */
function leaning(fist, size, opened) {
  const wide = size * (0.1 + 0.9 * opened);
  const up = new THREE.Vector3(0.02 - 0.75 * fist.x, -0.75 * fist.y, SHAFT * size).normalize();
  const ahead = new THREE.Vector3(up.z, 0, -up.x).normalize();
  const aside = new THREE.Vector3().crossVectors(up, ahead);
  return new THREE.Matrix4().makeBasis(ahead.multiplyScalar(wide), aside.multiplyScalar(wide), up.multiplyScalar(size));
}
