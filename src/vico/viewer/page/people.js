// Everybody on legs: fetched when they come near, posed in every picture, drawn whole or roughly by distance.

import { THREE } from "./three.js";
import { bytes } from "./city.js";
import { lampLight } from "./ground_meshes.js";
import { HOLD, heldAt, holdUp } from "./holds.js";
import { InHands } from "./in_hands.js";
import { isGait, poseOf, strideOf } from "./motion.js";
import { lightBy, personMaterial, standInMaterial } from "./person_material.js";
import { shadowAt, shadowMesh } from "./shadows.js";
import { JOINTS, PersonFile, Pose, forwardKinematics, writeBones } from "./skeleton.js";

const ROWS = 160;
const WIDTH = 3 * JOINTS;
/** Persons fetched at once, and metres from which somebody is worth it. */
const AT_ONCE = 3;
const FARTHEST = 260;
const TO_RADIANS = 1 / 10000;
/** Metres that a stand-in is made for. */
const STANDING = 1.7;

export class People {
  /**
   * @param {any} scene
   * @param {import("./light.js").Light} light
   * @param {import("./source.js").Source} source
   * @param {import("./city.js").City} city
   */
  constructor(scene, light, source, city) {
    this.scene = scene;
    this.light = light;
    this.source = source;
    this.city = city;
    this.nearReach = 28;
    this.arrived = 0;
    /** How many in view are still on their way. */
    this.pending = 0;
    this.bones = new Float32Array(4 * WIDTH * ROWS);
    this.texture = new THREE.DataTexture(this.bones, WIDTH, ROWS, THREE.RGBAFormat, THREE.FloatType);
    this.texture.minFilter = this.texture.magFilter = THREE.NearestFilter;
    /** @type {Map<number, any>} */
    this.known = new Map();
    this.free = Array.from({ length: ROWS }, (_, k) => ROWS - 1 - k);
    this.fetching = 0;
    this.shadows = shadowMesh(scene, ROWS);
    this.standIns = new THREE.InstancedMesh(new THREE.CapsuleGeometry(0.24, 1.22, 4, 12).rotateX(Math.PI / 2), standInMaterial(light), ROWS);
    this.standIns.frustumCulled = false;
    this.standIns.count = 0;
    scene.add(this.standIns);
    this.pose = new Pose();
    /** @type {Map<number, {left: any, right: any}>} places of hands, for what is held */
    this.hands = new Map();
    /** Umbrellas and placards. */
    this.inHands = new InHands(city);
    this.drawn = 0;
    this._frustum = new THREE.Frustum();
    this._matrix = new THREE.Matrix4();
    this._sphere = new THREE.Sphere(new THREE.Vector3(), 1.6);
  }

  /**
   * @param {import("./between.js").Between} between
   * @param {any} camera
   * @param {number} [hidden] who is not drawn: whose eyes one looks through
   */
  update(between, camera, hidden = 0) {
    const { before, after } = between;
    if (!before || !after) return;
    this._frustum.setFromProjectionMatrix(this._matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
    for (const person of this.known.values()) if (person.group) person.group.visible = false;
    this.drawn = 0;
    this.standIns.count = 0;
    this.hands.clear();
    this.inHands.begin();
    // Of everybody's bones those are handed on that are drawn now.
    this.texture.clearUpdateRanges();
    /** @type {[number, number, number][]} */
    const wanted = [];
    const entities = before.people.entity;
    for (let row = 0; row < entities.length; row++) {
      const entity = entities[row];
      const body = between.bodies.get(entity);
      if (!body) continue;
      this._sphere.center.set(body.x, body.y, body.z + 0.9);
      const away = camera.position.distanceTo(this._sphere.center);
      if (away > FARTHEST || !this._frustum.intersectsSphere(this._sphere)) continue;
      const room = roomOf(before, entity);
      // Rooms lie below the ground: who is in one is seen from inside alone, and from there nobody else.
      if ((room >= 0 ? (this.city.rooms?.rooms?.[room] ?? -2) : -1) !== this.city.inside) continue;
      const person = this.known.get(entity);
      if (!person) wanted.push([away, entity, row]);
      if (entity === hidden) continue;
      if (person?.group) this._draw(person, between, row, body, away);
      else this._standIn(entity, body);
    }
    this.pending = wanted.length + this.fetching;
    wanted.sort((a, b) => a[0] - b[0]);
    for (const [, entity] of wanted.slice(0, AT_ONCE - this.fetching)) this._fetch(entity);
    this.shadows.count = this.drawn;
    this.shadows.instanceMatrix.needsUpdate = true;
    this.standIns.instanceMatrix.needsUpdate = true;
    lightBy(this.light, this.standIns.material, this.city.inside >= 0);
    if (this.drawn) this.texture.needsUpdate = true;
  }

  /** Show where somebody is whose body is on its way. @param {number} entity @param {any} body */
  _standIn(entity, body) {
    if (this.standIns.count >= ROWS) return;
    const height = this.source.cast.get(entity)?.size[2] || STANDING;
    this._matrix.makeScale(1, 1, height / STANDING).setPosition(body.x, body.y, body.z + height / 2);
    this.standIns.setMatrixAt(this.standIns.count++, this._matrix);
  }

  /** @param {any} person @param {any} between @param {number} row @param {any} body @param {number} away */
  _draw(person, between, row, body, away) {
    const motion = motionAt(person.file, between, row);
    poseOf(person.file, motion, between.time, this.pose);
    const held = this._held(person, between, row);
    holdUp(person.file, this.pose, held);
    writeBones(person.file, this.pose, this.bones, 4 * WIDTH * person.row);
    this.texture.addUpdateRange(4 * WIDTH * person.row, 4 * WIDTH);
    const { group } = person;
    group.visible = true;
    lightBy(this.light, group.children[0].material, this.city.inside >= 0);
    group.children[0].material.uniforms.lamp.value = this.city.inside < 0 ? 0.75 * lampLight(this.city, body) : 0;
    const isNear = away < this.nearReach;
    group.children[0].visible = isNear;
    group.children[1].visible = !isNear;
    group.position.set(body.x, body.y, body.z);
    group.rotation.z = body.yaw;
    if (isNear) this._hands(person, body);
    if (held.hold !== HOLD.nothing && held.share > 0.25) this.inHands.draw(person, this.pose, body, held, row);
    shadowAt(this.shadows.instanceMatrix.array, this.drawn++, body.x, body.y, body.z + 0.03, 0.42, 0.36, body.yaw);
  }

  /** What somebody holds up or before them now. @param {any} person @param {any} between @param {number} row */
  _held(person, between, row) {
    const { before, after, share } = between;
    const held = heldAt(before.people, row, after.people, after.rows.people.get(person.entity), share);
    return { ...held, width: held.hold === HOLD.beforeChest ? this._widthHeld(before, person.entity) : 0 };
  }

  /** @param {any} frame @param {number} entity @returns {number} metres */
  _widthHeld(frame, entity) {
    const row = frame.rows.agents.get(entity);
    if (row === undefined) return 0;
    return Math.max(...["held_left", "held_right"].map((key) => this.source.cast.get(frame.agents[key][row])?.size[1] ?? 0));
  }

  /** @param {any} person @param {any} body */
  _hands(person, body) {
    const { placed, turned } = forwardKinematics(person.file, this.pose);
    const c = Math.cos(body.yaw);
    const s = Math.sin(body.yaw);
    const hand = (/** @type {number} */ wrist, /** @type {number} */ knuckle) => {
      const at = [0, 1, 2].map((k) => 0.3 * placed[3 * wrist + k] + 0.7 * placed[3 * knuckle + k]);
      return {
        x: body.x + c * at[0] - s * at[1],
        y: body.y + s * at[0] + c * at[1],
        z: body.z + at[2],
        quaternion: Array.from(turned.subarray(4 * wrist, 4 * wrist + 4)),
      };
    };
    this.hands.set(person.entity, { left: hand(20, 28), right: hand(21, 43) });
  }

  /** @param {number} entity */
  async _fetch(entity) {
    if (!this.free.length) this._forget();
    this.known.set(entity, {});
    this.fetching++;
    try {
      const file = new PersonFile(await bytes(`api/person/${entity}.bin`));
      this.known.set(entity, this._person(entity, file));
      this.arrived++;
    } catch {
      // Tried again when a while has passed: they may be dressing.
      setTimeout(() => this.known.delete(entity), 3000);
    } finally {
      this.fetching--;
    }
  }

  /** @param {number} entity @param {PersonFile} file */
  _person(entity, file) {
    const row = /** @type {number} */ (this.free.pop());
    const material = personMaterial(this.light, this.texture, row);
    const group = new THREE.Group();
    for (const level of [0, 1]) {
      const columns = file.mesh(level);
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(columns.position, 3));
      geometry.setAttribute("normal", new THREE.BufferAttribute(columns.normal, 3));
      geometry.setAttribute("colour", new THREE.BufferAttribute(columns.colour, 4, true));
      geometry.setAttribute("joints", new THREE.BufferAttribute(columns.joints, 4));
      geometry.setAttribute("weights", new THREE.BufferAttribute(columns.weights, 4, true));
      geometry.setIndex(new THREE.BufferAttribute(columns.index, 1));
      const mesh = new THREE.Mesh(geometry, material);
      mesh.frustumCulled = false;
      group.add(mesh);
    }
    this.scene.add(group);
    return { entity, file, row, group };
  }

  /** Let go of somebody who is not in the picture. */
  _forget() {
    for (const [entity, person] of this.known) {
      if (!person.group || person.group.visible) continue;
      this.scene.remove(person.group);
      this.light.receivers.delete(person.group.children[0].material);
      for (const mesh of person.group.children) mesh.geometry.dispose();
      this.free.push(person.row);
      this.known.delete(entity);
      return;
    }
  }

  /** Whoever changed clothes is fetched again. @param {number} entity */
  renew(entity) {
    const person = this.known.get(entity);
    if (!person?.group) return;
    this.scene.remove(person.group);
    this.light.receivers.delete(person.group.children[0].material);
    this.free.push(person.row);
    this.known.delete(entity);
  }
}

/** @param {any} frame @param {number} entity @returns {number} index of the room, -1 outdoors */
export function roomOf(frame, entity) {
  const row = frame.rows.agents.get(entity);
  return row === undefined ? -1 : frame.agents.room[row];
}

/**
 * How somebody moves between two steps.
 * @param {PersonFile} file
 * @param {import("./between.js").Between} between
 * @param {number} row in the frame before
 * @returns {import("./motion.js").Motion}
 */
export function motionAt(file, between, row) {
  const { before, after, share } = /** @type {any} */ (between);
  const names = file.head.motions;
  const a = before.people;
  const entity = a.entity[row];
  const other = after.rows.people.get(entity);
  const seconds = after.time - before.time;
  const from = motionOf(a, row);
  if (other === undefined || seconds <= 0) return from;
  const to = motionOf(after.people, other);
  const goesOn = to.clip === from.clip && (to.since >= from.since || to.since >= seconds);
  if (goesOn) {
    let gone = to.phase - from.phase;
    const stride = strideOf(names[from.clip].name, from.pace, file.height);
    const expected = Number.isFinite(stride) ? ((isGait(names[from.clip].name) ? (from.pace + to.pace) / 2 : speedOf(between, entity)) * seconds) / stride : 0;
    gone += Number.isFinite(stride) ? Math.round(expected - gone) : gone < -1e-6 ? 1 : 0;
    return { ...from, phase: from.phase + gone * share, pace: from.pace + (to.pace - from.pace) * share, since: from.since + share * seconds };
  }
  // They changed their motion on the way: until then they go on as they were.
  const since = to.since - (1 - share) * seconds;
  if (since < 0) {
    const stride = strideOf(names[from.clip].name, from.pace, file.height);
    const rate = Number.isFinite(stride) ? from.pace / stride : 0;
    return { ...from, phase: from.phase + rate * share * seconds, since: from.since + share * seconds };
  }
  const stride = strideOf(names[to.clip].name, to.pace, file.height);
  const rate = Number.isFinite(stride) ? to.pace / stride : 0;
  return { ...to, phase: to.phase - rate * (1 - share) * seconds, since };
}

/** @param {any} between @param {number} entity */
function speedOf(between, entity) {
  return between.bodies.get(entity)?.speed ?? 0;
}

/** @param {any} people @param {number} row @returns {import("./motion.js").Motion} */
function motionOf(people, row) {
  return {
    clip: people.clip[row],
    phase: people.phase[row] * TO_RADIANS,
    pace: people.pace[row] / 1000,
    clipBefore: people.clip_before[row],
    phaseBefore: people.phase_before[row] * TO_RADIANS,
    paceBefore: people.pace_before[row] / 1000,
    since: people.clip_time[row] / 100,
  };
}
