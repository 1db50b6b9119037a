// What goes on in the city: closed roads, markets, power cuts; marked in the picture, and told to the map.

import { THREE } from "./three.js";

const COLOUR = 0xd55e00;
const POINTS = 48;
/** Labels are shown within so many metres. */
const NAMED_WITHIN = 400;

/**
 * @typedef {object} Happening an event of the city that goes on
 * @property {number} id
 * @property {string} text what it is called
 * @property {string} event_kind
 * @property {number} x
 * @property {number} y
 * @property {number} z
 * @property {[number, number, number] | null} region x, y and radius
 */

/**
 * Return what goes on at a time.
 * @param {any[]} events of the run so far, in their order
 * @param {number} time
 * @returns {Happening[]}
 */
export function goingOn(events, time) {
  /** @type {Map<number, Happening>} */
  const found = new Map();
  for (const event of events) {
    if (event.kind !== "city" || event.time > time + 1e-6) continue;
    const { event: id, event_kind, region } = event.data;
    if (event.text.endsWith(" ends")) found.delete(id);
    else found.set(id, { id, text: event.text.replace(/ begins$/, ""), event_kind, x: event.x, y: event.y, z: event.z, region: region ?? null });
  }
  return [...found.values()];
}

/** Rings on the ground round what goes on, and labels above. */
export class Happenings {
  /** @param {any} scene @param {import("./view.js").View} view */
  constructor(scene, view) {
    this.view = view;
    this.group = new THREE.Group();
    scene.add(this.group);
    /** @type {Happening[]} */
    this.shown = [];
    this._key = "";
    this.material = new THREE.LineBasicMaterial({ color: COLOUR });
    this.wall = new THREE.MeshBasicMaterial({ color: COLOUR, transparent: true, opacity: 0.16, side: THREE.DoubleSide, depthWrite: false });
  }

  /** @param {Happening[]} events */
  show(events) {
    const key = events.map(({ id }) => id).join(" ");
    if (key === this._key) return;
    this._key = key;
    this.shown = events;
    for (const mesh of this.group.children) mesh.geometry.dispose();
    this.group.clear();
    for (const { region } of events) if (region) this._ring(region);
  }

  /** A low see-through wall that follows the ground. @param {[number, number, number]} region */
  _ring([x, y, radius]) {
    const points = [];
    const index = [];
    for (let k = 0; k <= POINTS; k++) {
      const angle = (2 * Math.PI * k) / POINTS;
      const at = { x: x + Math.cos(angle) * radius, y: y + Math.sin(angle) * radius };
      const z = this.view.groundAt(at);
      points.push(new THREE.Vector3(at.x, at.y, z + 0.1), new THREE.Vector3(at.x, at.y, z + 1.6));
      if (k < POINTS) index.push(2 * k, 2 * k + 2, 2 * k + 1, 2 * k + 1, 2 * k + 2, 2 * k + 3);
    }
    const wall = new THREE.BufferGeometry().setFromPoints(points).setIndex(index);
    const edge = new THREE.BufferGeometry().setFromPoints(points.filter((_, k) => k % 2));
    const mesh = new THREE.Mesh(wall, this.wall);
    mesh.renderOrder = 4;
    this.group.add(mesh, new THREE.Line(edge, this.material));
  }

  /** @returns {{entity: string, text: string, x: number, y: number, z: number, chosen: boolean, kind: string}[]} labels in reach */
  labels() {
    const { x, y, z } = this.view.camera.position;
    return this.shown
      .filter((one) => Math.hypot(one.x - x, one.y - y, one.z - z) < NAMED_WITHIN)
      .map((one) => ({ entity: `event ${one.id}`, text: one.text, x: one.x, y: one.y, z: one.z + 3, chosen: false, kind: "happening" }));
  }
}
