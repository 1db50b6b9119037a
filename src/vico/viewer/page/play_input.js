// What is held down: keys, mouse, fingers and gamepad, as one state.

/** Keys by code. @type {Record<string, string>} */
const HELD = {
  ArrowUp: "forward",
  ArrowDown: "back",
  ArrowLeft: "turn_left",
  ArrowRight: "turn_right",
  KeyW: "forward",
  KeyS: "back",
  KeyA: "left",
  KeyD: "right",
  ShiftLeft: "run",
  ShiftRight: "run",
  KeyR: "up",
  KeyF: "down",
  BracketLeft: "grip_close",
  BracketRight: "grip_open",
};
/** Axes by code: which, and which way. @type {Record<string, [string, number]>} */
const AXES = {
  KeyI: ["hand_x", 1],
  KeyK: ["hand_x", -1],
  KeyJ: ["hand_y", 1],
  KeyL: ["hand_y", -1],
  KeyU: ["hand_z", 1],
  KeyO: ["hand_z", -1],
};
const LOOKING = new Set(["KeyW", "KeyA", "KeyS", "KeyD"]);
const LOOK = 0.0032;
const STEEPEST = 1.2;
const STICK = 60;
/** Who drags a finger so many times as far as for walking runs. */
const RUNS = 1.6;
/** Buttons of a gamepad of the standard layout that do something once, by number; A does what is nearest at hand. @type {Record<number, string>} */
const BUTTONS = { 0: "first", 2: "N", 3: ">" };
const [RUN_BUTTON, STICK_BUTTON] = [1, 10];
const IDLE = 0.12;

export class Input {
  /** @param {HTMLElement} canvas @param {() => boolean} active */
  constructor(canvas, active) {
    this.canvas = canvas;
    this.active = active;
    /** @type {Set<string>} */
    this.codes = new Set();
    /** @type {Record<string, number>} */
    this.axes = {};
    this.yaw = 0;
    this.pitch = -0.12;
    /** Whether the gaze leads, and not the keys that turn. */
    this.looks = false;
    /** @type {Map<number, {x: number, y: number, left: boolean}>} */
    this._fingers = new Map();
    this._stick = { x: 0, y: 0, runs: false };
    /** What the gamepad holds down. @type {Set<string>} */
    this._padDown = new Set();
    /** Buttons of the gamepad that were down the last time. @type {Set<number>} */
    this._pressed = new Set();
    /** Told what is to be done once. @type {((key: string) => void) | null} */
    this.onButton = null;
    this._begun = false;
    this._listen();
  }

  release() {
    this.codes.clear();
    this._fingers.clear();
    this._stick = { x: 0, y: 0, runs: false };
    this._padDown.clear();
    this.axes = {};
  }

  _listen() {
    window.addEventListener("keydown", (event) => {
      const field = /** @type {any} */ (event.target).closest?.("input, select, textarea");
      if (!this.active() || field || event.ctrlKey || event.metaKey || event.altKey) return;
      if (!(event.code in HELD) && !(event.code in AXES)) return;
      this.codes.add(event.code);
      if (LOOKING.has(event.code)) this.looks = true;
      else if (event.code.startsWith("Arrow")) this.looks = false;
      event.preventDefault();
    });
    window.addEventListener("keyup", (event) => this.codes.delete(event.code));
    this.canvas.addEventListener("pointerdown", (event) => this._down(event));
    this.canvas.addEventListener("pointermove", (event) => this._move(event));
    for (const name of ["pointerup", "pointercancel"]) this.canvas.addEventListener(name, (event) => this._up(/** @type {PointerEvent} */ (event)));
  }

  /** @param {PointerEvent} event */
  _down(event) {
    if (!this.active()) return;
    this.canvas.focus({ preventScroll: true });
    const left = event.pointerType === "touch" && event.clientX < this.canvas.getBoundingClientRect().left + this.canvas.clientWidth * 0.4;
    this._fingers.set(event.pointerId, { x: event.clientX, y: event.clientY, left });
    if (event.pointerType === "mouse" && event.button === 0 && document.pointerLockElement !== this.canvas) {
      // Where the browser or a frame forbids it, dragging looks about.
      Promise.resolve(this.canvas.requestPointerLock?.()).catch(() => {});
    }
  }

  /** @param {PointerEvent} event */
  _move(event) {
    if (!this.active()) return;
    const finger = this._fingers.get(event.pointerId);
    if (document.pointerLockElement === this.canvas) this._look(event.movementX, event.movementY);
    else if (finger?.left) {
      const [x, y] = [(event.clientX - finger.x) / STICK, (finger.y - event.clientY) / STICK];
      this._stick = { x: clamp(x), y: clamp(y), runs: Math.hypot(x, y) > RUNS };
    }
    else if (finger) {
      this._look(event.clientX - finger.x, event.clientY - finger.y);
      finger.x = event.clientX;
      finger.y = event.clientY;
    }
  }

  /** @param {PointerEvent} event */
  _up(event) {
    if (this._fingers.get(event.pointerId)?.left) this._stick = { x: 0, y: 0, runs: false };
    this._fingers.delete(event.pointerId);
  }

  /** @param {number} dx @param {number} dy pixels */
  _look(dx, dy) {
    this.looks = true;
    this.yaw -= dx * LOOK;
    this.pitch = Math.min(Math.max(this.pitch - dy * LOOK, -STEEPEST), STEEPEST);
  }

  /**
   * Take in sticks, and return what is held.
   * @param {number} seconds since the last time
   * @param {number} yaw of the body
   */
  read(seconds, yaw) {
    if (!this._begun && Number.isFinite(yaw)) {
      this.yaw = yaw;
      this._begun = true;
    }
    /** @type {Record<string, number>} */
    const axes = {};
    for (const code of this.codes) {
      const axis = AXES[code];
      if (axis) axes[axis[0]] = (axes[axis[0]] ?? 0) + axis[1];
    }
    if (this._stick.x || this._stick.y) {
      this.looks = true;
      axes.x = this._stick.x;
      axes.y = this._stick.y;
    }
    const pad = [...(navigator.getGamepads?.() ?? [])].find(Boolean);
    this._padDown.clear();
    if (pad) this._pad(pad, axes, seconds);
    this.axes = axes;
    return this.message();
  }

  /** @param {Gamepad} pad @param {Record<string, number>} axes @param {number} seconds */
  _pad(pad, axes, seconds) {
    const at = (/** @type {number} */ k) => (Math.abs(pad.axes[k] ?? 0) < IDLE ? 0 : pad.axes[k]);
    if (at(0) || at(1)) {
      this.looks = true;
      axes.x = clamp((axes.x ?? 0) + at(0));
      axes.y = clamp((axes.y ?? 0) - at(1));
    }
    if (at(2) || at(3)) this._look((at(2) * seconds * 2.2) / LOOK, (at(3) * seconds * 1.6) / LOOK);
    const up = (pad.buttons[7]?.value ?? 0) - (pad.buttons[6]?.value ?? 0);
    if (Math.abs(up) > IDLE) axes.up = up;
    // The cross leads an arm's hand.
    const button = (/** @type {number} */ k) => Number(pad.buttons[k]?.pressed ?? false);
    if (button(12) !== button(13)) axes.hand_x = button(12) - button(13);
    if (button(14) !== button(15)) axes.hand_y = button(14) - button(15);
    if (button(5) !== button(4)) axes.hand_z = button(5) - button(4);
    if (button(RUN_BUTTON) || button(STICK_BUTTON)) this._padDown.add("run");
    for (const [number, key] of Object.entries(BUTTONS)) {
      const k = Number(number);
      if (button(k) && !this._pressed.has(k)) this.onButton?.(key);
      if (button(k)) this._pressed.add(k);
      else this._pressed.delete(k);
    }
  }

  message() {
    const down = [...new Set([...[...this.codes].map((code) => HELD[code]).filter(Boolean), ...this._padDown, ...(this._stick.runs ? ["run"] : [])])];
    const turns = down.includes("turn_left") || down.includes("turn_right");
    return { down, yaw: this.looks && !turns ? wrap(this.yaw) : null, pitch: this.pitch, axes: this.axes };
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
