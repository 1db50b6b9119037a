// Where the own body is about to be: moved by the rules of vico.agents.human, without walls, and led back to what the
// server says.

const WALK = 1;
const RUN = 2.5;
const BIKE = 3;
const TURN = (120 * Math.PI) / 180;
const SWING = (360 * Math.PI) / 180;
const TURNS_FIRST = (60 * Math.PI) / 180;
/** What the server says is as old as this, seconds: a step, and the way here. */
const AGE = 0.13;
const PULL = 7;
const LEAP = 1.5;

export class Predicted {
  constructor() {
    this.x = this.y = this.z = 0;
    this.yaw = NaN;
    /** @type {{at: number, dx: number, dy: number, turn: number}[]} */
    this._moves = [];
    this._off = { x: 0, y: 0, z: 0, yaw: 0 };
  }

  /** Whether the prediction holds: on foot or a bicycle, through no door. @param {any} you */
  rules(you) {
    return Boolean(you) && you.kind === "person" && !you.busy && you.vehicle !== "bus" && you.posture === "standing" && Number.isFinite(this.yaw);
  }

  /** @param {any} you what the server says @param {number} now */
  correct(you, now) {
    const [x, y, z] = you.position;
    if (!Number.isFinite(this.yaw) || !this.rules(you)) return this._put(x, y, z, you.yaw);
    let dx = 0;
    let dy = 0;
    let turn = 0;
    // A wall stopped it: what is predicted since then is nothing.
    const stopped = you.status === "collision";
    this._moves = this._moves.filter((move) => now - move.at < 1000 * AGE);
    if (!stopped)
      for (const move of this._moves) {
        dx += move.dx;
        dy += move.dy;
      }
    for (const move of this._moves) turn += move.turn;
    const off = { x: x + dx - this.x, y: y + dy - this.y, z: z - this.z, yaw: wrap(you.yaw + turn - this.yaw) };
    if (Math.hypot(off.x, off.y) > LEAP || Math.abs(off.z) > LEAP) return this._put(x, y, z, you.yaw);
    this._off = off;
  }

  /** @param {number} x @param {number} y @param {number} z @param {number} yaw */
  _put(x, y, z, yaw) {
    this.x = x;
    this.y = y;
    this.z = z;
    this.yaw = yaw;
    this._off = { x: 0, y: 0, z: 0, yaw: 0 };
    this._moves = [];
  }

  /**
   * @param {number} seconds
   * @param {{down: string[], yaw: number | null, axes: Record<string, number>}} held
   * @param {any} you
   * @param {number} now
   */
  advance(seconds, held, you, now) {
    if (!this.rules(you)) return;
    const has = (/** @type {string} */ key) => Number(held.down.includes(key));
    const stick = (/** @type {string} */ axis) => held.axes[axis] ?? 0;
    const ahead = clamp(stick("y") + has("forward") - has("back"));
    const aside = clamp(stick("x") + has("right") - has("left"));
    const turning = clamp(stick("turn") + has("turn_left") - has("turn_right"));
    const push = Math.min(Math.hypot(ahead, aside), 1);
    const speed = you.vehicle === "bike" ? BIKE : has("run") ? RUN : WALK;
    let turn = turning * TURN * seconds;
    let walks = push > 0;
    if (!turning && (push > 0 || held.yaw !== null)) {
      const looks = held.yaw ?? this.yaw;
      const away = wrap(looks + (push > 0 ? Math.atan2(-aside, ahead) : 0) - this.yaw);
      turn = Math.sign(away) * Math.min(Math.abs(away), SWING * seconds);
      walks = push > 0 && Math.abs(away) <= TURNS_FIRST;
    }
    this.yaw = wrap(this.yaw + turn);
    const step = walks ? speed * push * seconds : 0;
    const dx = Math.cos(this.yaw) * step;
    const dy = Math.sin(this.yaw) * step;
    this.x += dx;
    this.y += dy;
    this._moves.push({ at: now, dx, dy, turn });
    const share = 1 - Math.exp(-PULL * seconds);
    for (const key of /** @type {const} */ (["x", "y", "z"])) {
      this[key] += this._off[key] * share;
      this._off[key] *= 1 - share;
    }
    this.yaw = wrap(this.yaw + this._off.yaw * share);
    this._off.yaw *= 1 - share;
  }
}

/** @param {number} value */
function clamp(value) {
  return Math.min(Math.max(value, -1), 1);
}

/** @param {number} angle */
function wrap(angle) {
  return Math.atan2(Math.sin(angle), Math.cos(angle));
}
