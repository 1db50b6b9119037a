// Where the picture is taken from: round a point, behind somebody, through somebody's eyes, or from straight above.

import { THREE } from "./three.js";

/** @typedef {"orbit" | "follow" | "first" | "bird" | "play"} Mode */
export const MODES = ["orbit", "follow", "first", "bird"];

const KEY_SPEED = 14;
/** Metres between a camera and a wall, and to the side of its middle that are kept free. */
const OFF_WALLS = 0.3;
/** Where a camera that follows somebody looks for room, radians from behind them, and how much it wants, metres. */
const TURNS = [0, 0.5, -0.5, 1, -1, 1.6, -1.6, 2.3, -2.3, 3.1];
const [ROOMY, CRAMPED] = [2.2, 1.3];

export class Cameras {
  /**
   * @param {any} camera
   * @param {HTMLElement} canvas
   * @param {(target: {x: number, y: number}) => number} groundAt
   * @param {(from: any, way: any, reach: number) => number} sight how far one sees from a point, metres
   */
  constructor(camera, canvas, groundAt, sight) {
    this.sight = sight;
    this.camera = camera;
    this.canvas = canvas;
    this.groundAt = groundAt;
    /** @type {Mode} */
    this.mode = "orbit";
    this.target = new THREE.Vector3(0, 0, 2);
    this.yaw = 0.9;
    this.pitch = 0.5;
    this.distance = 160;
    /** Degrees across the shorter way up. */
    camera.fov = 55;
    /** Radians from where a camera that follows would be to where there is room for it. */
    this._aside = 0;
    /** Keys held down, by code. */
    this.down = new Set();
    this.enabled = true;
    /** @type {(() => void) | null} */
    this.onChange = null;
    this._listen();
  }

  /** @param {Mode} mode */
  setMode(mode) {
    if (mode === this.mode) return;
    if (mode === "bird") {
      this.pitch = Math.PI / 2 - 0.001;
      this.distance = Math.max(this.distance, 220);
    } else if (mode === "follow") {
      this.distance = 7;
      this.pitch = 0.28;
    } else if (mode === "orbit" && (this.mode === "bird" || this.mode === "first")) {
      this.pitch = 0.5;
      this.distance = Math.max(20, Math.min(this.distance, 160));
    }
    this._relative = mode === "follow" ? Math.PI : 0;
    this.mode = mode;
    this.onChange?.();
  }

  _listen() {
    const { canvas } = this;
    let button = -1;
    let moved = 0;
    /** @type {Map<number, PointerEvent>} */
    const fingers = new Map();
    canvas.addEventListener("pointerdown", (event) => {
      if (this.mode === "play") return;
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, event);
      button = event.button;
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const last = fingers.get(event.pointerId);
      if (!last || this.mode === "play" || !this.enabled) return;
      const dx = event.clientX - last.clientX;
      const dy = event.clientY - last.clientY;
      moved += Math.abs(dx) + Math.abs(dy);
      if (fingers.size === 2) {
        const [a, b] = [...fingers.values()];
        const before = Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY);
        fingers.set(event.pointerId, event);
        const [c, d] = [...fingers.values()];
        const after = Math.hypot(c.clientX - d.clientX, c.clientY - d.clientY);
        this.zoom(before / Math.max(after, 1));
        this.pan(dx / 2, dy / 2);
      } else if (button === 2 || button === 1 || event.shiftKey || (this.mode === "bird" && button === 0)) this.pan(dx, dy);
      else this.rotate(dx, dy);
      fingers.set(event.pointerId, event);
    });
    const release = (/** @type {PointerEvent} */ event) => {
      fingers.delete(event.pointerId);
      canvas.dispatchEvent(new CustomEvent("tap", { detail: { event, moved } }));
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", (event) => fingers.delete(event.pointerId));
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        if (this.mode === "play") return;
        event.preventDefault();
        this.zoom(Math.exp(Math.sign(event.deltaY) * Math.min(Math.abs(event.deltaY), 100) * 0.0018));
      },
      { passive: false },
    );
  }

  /** @param {number} dx @param {number} dy pixels */
  rotate(dx, dy) {
    this.yaw -= dx * 0.006;
    if (this.mode === "follow") this._relative = (this._relative ?? Math.PI) - dx * 0.006;
    const least = this.mode === "first" ? -1.3 : 0.03;
    this.pitch = Math.min(Math.max(this.pitch + (this.mode === "first" ? -dy : dy) * 0.005, least), Math.PI / 2 - 0.001);
  }

  /** @param {number} dx @param {number} dy pixels */
  pan(dx, dy) {
    if (this.mode === "follow" || this.mode === "first") this.setMode("orbit");
    const scale = (this.distance * Math.tan((this.camera.fov * Math.PI) / 360) * 2) / this.canvas.clientHeight;
    const c = Math.cos(this.yaw);
    const s = Math.sin(this.yaw);
    const ahead = (dy * scale) / Math.max(0.35, Math.sin(this.pitch));
    // The camera looks from the target's side `yaw`: right is a quarter turn from there.
    this.target.x += s * dx * scale - c * ahead;
    this.target.y += -c * dx * scale - s * ahead;
    this._settle();
  }

  /** @param {number} factor */
  zoom(factor) {
    this.distance = Math.min(Math.max(this.distance * factor, this.mode === "follow" ? 1.6 : 3), 1400);
  }

  _settle() {
    this.target.z = this.groundAt(this.target) + 1.4;
  }

  /**
   * Go where a point is.
   * @param {number} x
   * @param {number} y
   * @param {number} z
   * @param {number} [distance]
   */
  lookAt(x, y, z, distance = 30) {
    this.setMode(this.mode === "bird" ? "bird" : "orbit");
    this.target.set(x, y, z);
    this.distance = this.mode === "bird" ? Math.max(distance, 120) : distance;
    if (this.mode === "orbit") this._findSight();
  }

  /** Turn, and look down more steeply, until nothing stands between camera and target. */
  _findSight() {
    for (const pitch of [this.pitch, 0.45, 0.65, 0.9]) {
      if (pitch < this.pitch) continue;
      for (const turn of TURNS) {
        if (this.sight(this.target, this._away(this.yaw + turn, pitch), this.distance) < this.distance) continue;
        this.yaw += turn;
        this.pitch = pitch;
        return;
      }
    }
    this.pitch = Math.max(this.pitch, 1.2);
  }

  /** @param {number} yaw @param {number} pitch @returns {any} the way from the target to the camera */
  _away(yaw, pitch) {
    return new THREE.Vector3(Math.cos(yaw) * Math.cos(pitch), Math.sin(yaw) * Math.cos(pitch), Math.sin(pitch));
  }

  /**
   * How far back a camera may go from its target without meeting a wall, with its middle or its sides.
   * @param {number} yaw @param {number} distance metres wanted
   */
  _free(yaw, distance) {
    const way = this._away(yaw, this.pitch);
    const aside = new THREE.Vector3(-Math.sin(yaw), Math.cos(yaw), 0).multiplyScalar(OFF_WALLS);
    const reaches = [-1, 0, 1].map((side) => {
      const along = way.clone().multiplyScalar(distance).addScaledVector(aside, side);
      const reach = along.length();
      return (this.sight(this.target, along.normalize(), reach) / reach) * distance;
    });
    const free = Math.min(...reaches);
    return free < distance ? Math.max(free - OFF_WALLS, 0.5) : distance;
  }

  /** Look for room indoors: not from behind whoever has a wall at their back. @param {number} behind yaw */
  _findRoom(behind) {
    if (this._free(behind + this._aside, ROOMY) >= CRAMPED) return;
    const free = TURNS.map((turn) => this._free(behind + turn, ROOMY));
    const most = Math.max(...free);
    this._aside = TURNS[free.findIndex((reach) => reach > most - 0.2)];
  }

  /**
   * @param {number} seconds since the last time
   * @param {{x: number, y: number, z: number, yaw: number, height: number, pitch: number, room?: number} | null} followed
   */
  update(seconds, followed) {
    if (this.mode === "play") return;
    if (!followed && (this.mode === "follow" || this.mode === "first")) this.setMode("orbit");
    this._keys(seconds);
    const { camera } = this;
    if (followed && this.mode === "first") {
      const eye = followed.z + followed.height * 0.93;
      const ahead = followed.yaw;
      camera.position.set(followed.x + 0.12 * Math.cos(ahead), followed.y + 0.12 * Math.sin(ahead), eye);
      const pitch = followed.pitch + (this.pitch - 0.28);
      camera.lookAt(
        camera.position.x + Math.cos(ahead) * Math.cos(pitch),
        camera.position.y + Math.sin(ahead) * Math.cos(pitch),
        camera.position.z + Math.sin(pitch),
      );
      return;
    }
    const isInside = Boolean(followed) && (followed?.room ?? -1) >= 0 && this.mode !== "bird";
    if (followed && this.mode === "follow") {
      const goal = new THREE.Vector3(followed.x, followed.y, followed.z + followed.height * 0.75);
      const share = this.target.distanceToSquared(goal) > 900 ? 1 : 1 - Math.exp(-8 * seconds);
      this.target.lerp(goal, share);
      const behind = followed.yaw + (this._relative ?? Math.PI);
      if (isInside) this._findRoom(behind);
      else this._aside = 0;
      let turn = behind + this._aside - this.yaw;
      turn = Math.atan2(Math.sin(turn), Math.cos(turn));
      this.yaw += turn * (1 - Math.exp(-2.5 * seconds));
    }
    if (isInside && followed) this.target.set(followed.x, followed.y, followed.z + 1.2);
    let distance = isInside ? Math.min(this.distance, 11) : this.distance;
    if (this.mode === "follow") distance = this._free(this.yaw, distance);
    const pitch = isInside && this.mode === "orbit" ? Math.max(this.pitch, 0.55) : this.pitch;
    const flat = Math.cos(pitch) * distance;
    const z = this.target.z + Math.sin(pitch) * distance;
    camera.position.set(this.target.x + Math.cos(this.yaw) * flat, this.target.y + Math.sin(this.yaw) * flat, z);
    const floor = this.groundAt(camera.position) + 0.5;
    if (!isInside && camera.position.z < floor) camera.position.z = floor;
    if (this.mode === "bird") {
      camera.up.set(-Math.cos(this.yaw), -Math.sin(this.yaw), 0);
      camera.lookAt(this.target);
      camera.up.set(0, 0, 1);
    } else camera.lookAt(this.target);
  }

  /** @param {number} seconds */
  _keys(seconds) {
    if (!this.enabled || !this.down.size) return;
    const has = (/** @type {string[]} */ ...codes) => codes.some((code) => this.down.has(code));
    const ahead = Number(has("KeyW", "ArrowUp")) - Number(has("KeyS", "ArrowDown"));
    const right = Number(has("KeyD", "ArrowRight")) - Number(has("KeyA", "ArrowLeft"));
    const turn = Number(has("KeyQ")) - Number(has("KeyE"));
    if (turn) {
      this.yaw -= turn * 1.4 * seconds;
      if (this._relative !== undefined) this._relative -= turn * 1.4 * seconds;
    }
    if (!ahead && !right) return;
    if (this.mode !== "bird") this.setMode("orbit");
    const step = KEY_SPEED * Math.max(this.distance / 30, 0.4) * seconds;
    const c = Math.cos(this.yaw);
    const s = Math.sin(this.yaw);
    this.target.x += (-c * ahead - s * right) * step;
    this.target.y += (-s * ahead + c * right) * step;
    this._settle();
  }
}
