// Traffic signals: what they show follows from the second of the day; dark where an event has cut the power.

import { THREE } from "./three.js";
import { getJson } from "./source.js";

/** Metres from which lenses are drawn. */
const SEEN = 180;
/** @type {Record<string, string>} */
const NAMES = { g: "green", a: "amber", r: "red", "-": "dark" };

export class Signals {
  constructor() {
    /** @type {any[]} */
    this.heads = [];
    /** Whether the server has told of them. */
    this.known = false;
    /** @type {string[]} */
    this.cycles = [];
    /** @type {Set<string>} kinds of events that cut the power */
    this.cuts = new Set();
    /** @type {any[]} what goes on in the city now */
    this.events = [];
    this._matrix = new THREE.Matrix4();
    this._sphere = new THREE.Sphere(undefined, 3);
  }

  /** Ask for them: the server may have to look at all streets first. */
  async load() {
    const told = await getJson("api/signals").catch(() => null);
    this.known = true;
    if (!told) return;
    this.cycles = told.cycles;
    this.cuts = new Set(told.dark_events);
    this.heads = told.heads.map((/** @type {any} */ head) => {
      const [x, y, z] = head.at;
      const matrix = new THREE.Matrix4().makeRotationZ(head.yaw).scale(new THREE.Vector3(head.scale, head.scale, head.scale)).setPosition(x, y, z);
      return { ...head, matrix, middle: new THREE.Vector3(x, y, z + 2.5) };
    });
  }

  /**
   * @param {any} head
   * @param {number} second since midnight of the first day
   * @returns {string} what a head shows: green, amber, red or dark
   */
  shown(head, second) {
    const dark = this.events.some(({ event_kind, region }) => region && this.cuts.has(event_kind) && Math.hypot(head.junction[0] - region[0], head.junction[1] - region[1]) <= region[2]);
    const cycle = this.cycles[head.cycle];
    return dark ? "dark" : NAMES[cycle[Math.floor(second + 1e-6) % cycle.length]];
  }

  /**
   * Draw what is in view.
   * @param {number} second
   * @param {any} eye
   * @param {any} frustum
   * @param {(name: string, matrix: any) => void} add
   */
  draw(second, eye, frustum, add) {
    for (const head of this.heads) {
      if (eye.distanceTo(head.middle) > SEEN) continue;
      this._sphere.center.copy(head.middle);
      if (!frustum.intersectsSphere(this._sphere)) continue;
      if (head.kind === "signal_post") {
        add(head.kind, head.matrix);
        continue;
      }
      const light = this.shown(head, second);
      // People have no amber: what is not green is red.
      add(`${head.kind}_${head.kind === "walk" && light === "amber" ? "red" : light}`, head.matrix);
    }
  }
}
