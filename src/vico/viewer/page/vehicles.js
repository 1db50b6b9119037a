// Vehicles with their lamps, bicycles, and things that lie about or are carried.

import { THREE } from "./three.js";
import { shadowAt, shadowMesh } from "./shadows.js";
import { Signals } from "./signals.js";

const VEHICLES = new Set(["car", "bus", "tram", "bicycle", "cyclist"]);
const NEAR = 55;
const FARTHEST = 700;
/** Lamps that blink are lit for this share of a second, this often a second. */
const BLINKS = 1.5;
const [BRAKES, LEFT, RIGHT] = [1, 2, 4];
/** Kinds of cars by their length, for recordings that do not tell. */
const LENGTHS = { hatchback: 4.0, sedan: 4.7, suv: 4.6, van: 5.1 };
/** @type {Record<string, string[]>} */
const PAINTS = { hatchback: ["red", "white", "blue", "silver"], sedan: ["black", "silver", "grey", "blue"], suv: ["white", "grey", "green", "black"], van: ["white", "silver", "sand"] };

/** Of each shape one call, for as many as there are. */
class Batch {
  /** @param {any} scene @param {any} city @param {any} part */
  constructor(scene, city, part) {
    this.scene = scene;
    this.city = city;
    this.part = part;
    this.count = 0;
    this.mesh = this._mesh(16);
  }

  /** @param {number} size @returns {any} */
  _mesh(size) {
    const mesh = new THREE.InstancedMesh(this.part.geometry, this.city.instancedMaterials[this.part.array], size);
    mesh.frustumCulled = false;
    mesh.matrixAutoUpdate = false;
    this.scene.add(mesh);
    return mesh;
  }

  /** @param {any} matrix */
  add(matrix) {
    if (this.count >= this.mesh.instanceMatrix.count) {
      const larger = this._mesh(2 * this.mesh.instanceMatrix.count);
      larger.instanceMatrix.array.set(this.mesh.instanceMatrix.array);
      this.scene.remove(this.mesh);
      this.mesh.dispose();
      this.mesh = larger;
    }
    matrix.toArray(this.mesh.instanceMatrix.array, 16 * this.count++);
  }

  finish() {
    this.mesh.count = this.count;
    this.mesh.visible = this.count > 0;
    if (this.count) this.mesh.instanceMatrix.needsUpdate = true;
    this.count = 0;
  }
}

export class Vehicles {
  /** @param {any} scene @param {import("./city.js").City} city @param {any} light @param {import("./source.js").Source} source */
  constructor(scene, city, light, source) {
    this.scene = scene;
    this.city = city;
    this.light = light;
    this.source = source;
    /** @type {Map<string, Batch[][]>} */
    this.batches = new Map();
    this.shadows = shadowMesh(scene, 400);
    this.signals = new Signals();
    // After what the first pictures need.
    city.ready.then(() => this.signals.load());
    this._matrix = new THREE.Matrix4();
    this._frustum = new THREE.Frustum();
    this._sphere = new THREE.Sphere();
    /** @type {Map<number, string>} */
    this._models = new Map();
    /** @type {import("./people.js").People | null} */
    this.people = null;
  }

  /** @param {string} name @returns {Batch[][] | null} */
  _batchesOf(name) {
    const known = this.batches.get(name);
    if (known) return known;
    const model = this.city.models.get(name);
    if (!model) return null;
    const made = [model.near, model.far].map((parts) => parts.map((/** @type {any} */ part) => new Batch(this.scene, this.city, part)));
    this.batches.set(name, made);
    return made;
  }

  /** @param {any} member @returns {string} */
  modelOf(member) {
    const known = this._models.get(member.entity);
    if (known) return known;
    let name = member.model ?? member.shape;
    if (!name) {
      if (member.kind === "car") {
        const kind = Object.entries(LENGTHS).sort((a, b) => Math.abs(a[1] - member.size[0]) - Math.abs(b[1] - member.size[0]))[0][0];
        name = `${kind}_${PAINTS[kind][member.entity % PAINTS[kind].length]}`;
      } else if (member.kind === "tram") name = "tram_middle";
      else if (member.kind === "cyclist") name = ["bicycle_black", "bicycle_red", "bicycle_blue"][member.entity % 3];
      else name = member.kind;
    }
    this._models.set(member.entity, name);
    return name;
  }

  /** @param {import("./between.js").Between} between @param {any} camera @param {number} now */
  update(between, camera, now) {
    if (!this.city.models.size) return;
    const both = new THREE.Matrix4().multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    this._frustum.setFromProjectionMatrix(both);
    const held = heldIn(between.before);
    let shadows = 0;
    for (const [entity, body] of between.bodies) {
      const member = this.source.cast.get(entity);
      if (!member) continue;
      const isVehicle = VEHICLES.has(member.kind);
      if (!isVehicle && member.kind !== "object" && member.kind !== "fixture") continue;
      const radius = 0.6 * Math.max(member.size[0], 1);
      this._sphere.center.set(body.x, body.y, body.z + 1);
      this._sphere.radius = radius + 1.5;
      const away = camera.position.distanceTo(this._sphere.center);
      if (away > (isVehicle ? FARTHEST : 90) || !this._frustum.intersectsSphere(this._sphere)) continue;
      this._place(entity, body, held);
      const name = this.modelOf(member);
      this._add(name, away < NEAR ? 0 : 1);
      if (!isVehicle) continue;
      this._lamps(name, body.lights, now, away);
      if (shadows < 400 && body.z > -2) {
        shadowAt(this.shadows.instanceMatrix.array, shadows++, body.x, body.y, body.z + 0.04, member.size[0] * 0.58, member.size[1] * 0.66, body.yaw);
      }
    }
    this._rented(between);
    for (const { name, matrix } of this.people?.inHands.shown ?? []) {
      this._matrix.copy(matrix);
      this._add(name, 0);
    }
    this.signals.draw(between.time, camera.position, this._frustum, (name, matrix) => {
      this._matrix.copy(matrix);
      this._add(name, 0);
    });
    this.shadows.count = shadows;
    this.shadows.instanceMatrix.needsUpdate = true;
    for (const levels of this.batches.values()) for (const level of levels) for (const batch of level) batch.finish();
  }

  /** @param {number} entity @param {any} body @param {Map<number, [number, "left" | "right"]>} held */
  _place(entity, body, held) {
    const holder = held.get(entity);
    const hands = holder ? this.people?.hands.get(holder[0]) : null;
    if (holder && hands) {
      const hand = hands[holder[1]];
      this._matrix.makeRotationZ(body.yaw).setPosition(hand.x, hand.y, hand.z - 0.12);
    } else this._matrix.makeRotationZ(body.yaw).setPosition(body.x, body.y, body.z);
  }

  /** @param {string} name @param {number} level */
  _add(name, level) {
    const batches = this._batchesOf(name);
    if (!batches) return;
    for (const batch of batches[level].length ? batches[level] : batches[0]) batch.add(this._matrix);
  }

  /** @param {string} name @param {number} lights @param {number} now @param {number} away */
  _lamps(name, lights, now, away) {
    const kind = name.split("_")[0];
    if (this.light.night.value > 0.25) this._add(`${kind}:night`, 0);
    if (away > 150) return;
    if (lights & BRAKES) this._add(`${kind}:brake`, 0);
    if ((now / 1000) * BLINKS % 1 < 0.5) {
      if (lights & LEFT) this._add(`${kind}:left`, 0);
      if (lights & RIGHT) this._add(`${kind}:right`, 0);
    }
  }

  /** Bicycles that residents ride: they are no bodies of their own. @param {import("./between.js").Between} between */
  _rented(between) {
    const people = /** @type {any} */ (between.before)?.people;
    if (!people) return;
    const riding = this.source.run.clips?.indexOf("ride_bike") ?? -1;
    for (let row = 0; row < people.entity.length; row++) {
      if (people.clip[row] !== riding) continue;
      const body = between.bodies.get(people.entity[row]);
      const member = this.source.cast.get(people.entity[row]);
      if (!body || member?.kind === "cyclist") continue;
      this._matrix.makeRotationZ(body.yaw).setPosition(body.x, body.y, body.z);
      this._add("bicycle", 0);
    }
  }
}

/** @param {any} frame @returns {Map<number, [number, "left" | "right"]>} who holds what in which hand */
function heldIn(frame) {
  const found = new Map();
  const { entity, held_left, held_right } = frame.agents;
  for (let row = 0; row < entity.length; row++) {
    if (held_left[row]) found.set(held_left[row], [entity[row], "left"]);
    if (held_right[row]) found.set(held_right[row], [entity[row], "right"]);
  }
  return found;
}
