// The state between two steps: positions on the line between them, motions on from where they were.

/** @typedef {import("./protocol.js").Frame} Frame */

const TURN = 20000 * Math.PI;
/** Who moves farther in a step than this many metres went through a door, or was put elsewhere. */
const JUMP = 25;

/**
 * @typedef {object} Placed
 * @property {number} x
 * @property {number} y
 * @property {number} z
 * @property {number} yaw
 * @property {number} speed
 * @property {number} lights
 */

/** The bodies at a moment, by entity; the records are used again at the next. */
export class Between {
  constructor() {
    /** @type {Map<number, Placed & {seen: number}>} */
    this.bodies = new Map();
    /** @type {Frame | null} */
    this.before = null;
    /** @type {Frame | null} */
    this.after = null;
    this.share = 0;
    this.time = 0;
    this._round = 0;
  }

  /**
   * @param {Frame} before
   * @param {Frame} after
   * @param {number} share
   */
  set(before, after, share) {
    this.before = before;
    this.after = after;
    this.share = share;
    this.time = before.time + (after.time - before.time) * share;
    this._round++;
    const { entity, x, y, z, yaw, speed, lights } = /** @type {any} */ (before.bodies);
    const to = /** @type {any} */ (after.bodies);
    const rows = after.rows.bodies;
    for (let k = 0; k < entity.length; k++) {
      const row = rows.get(entity[k]);
      let body = this.bodies.get(entity[k]);
      if (!body) {
        body = { x: 0, y: 0, z: 0, yaw: 0, speed: 0, lights: 0, seen: 0 };
        this.bodies.set(entity[k], body);
      }
      body.seen = this._round;
      body.lights = lights[k];
      if (row === undefined) {
        put(body, x[k], y[k], z[k], yaw[k], speed[k]);
        continue;
      }
      const dx = to.x[row] - x[k];
      const dy = to.y[row] - y[k];
      const far = dx * dx + dy * dy > (JUMP * 1000) ** 2 || Math.abs(to.z[row] - z[k]) > 3000;
      const s = far ? (share < 0.5 ? 0 : 1) : share;
      let turn = (to.yaw[row] - yaw[k]) % TURN;
      if (turn > TURN / 2) turn -= TURN;
      if (turn < -TURN / 2) turn += TURN;
      put(
        body,
        x[k] + dx * s,
        y[k] + dy * s,
        z[k] + (to.z[row] - z[k]) * s,
        yaw[k] + turn * s,
        speed[k] + (to.speed[row] - speed[k]) * s,
      );
      if (share > 0.5) body.lights = to.lights[row];
    }
    for (const [key, body] of this.bodies) if (body.seen !== this._round) this.bodies.delete(key);
  }
}

/**
 * @param {Placed} body
 * @param {number} x
 * @param {number} y
 * @param {number} z
 * @param {number} yaw
 * @param {number} speed
 */
function put(body, x, y, z, yaw, speed) {
  body.x = x / 1000;
  body.y = y / 1000;
  body.z = z / 1000;
  body.yaw = yaw / 10000;
  body.speed = speed / 1000;
}
