// The map beside the 3D picture, or in its place: streets, buildings, who is where, and what the camera sees.

import { KIND_COLOURS } from "./dom.js";

export class CityMap {
  /**
   * @param {HTMLCanvasElement} canvas
   * @param {import("./ground.js").CityBase} base
   * @param {{select: (entity: number) => void, look: (x: number, y: number) => void, place: (at: {x: number, y: number}) => void, kindOf: (entity: number) => string}} actions
   */
  constructor(canvas, base, actions) {
    this.canvas = canvas;
    this.base = base;
    this.actions = actions;
    this.context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    this.x = 0;
    this.y = 0;
    /** Pixels a metre. */
    this.scale = 0;
    this.turnedOff = false;
    this.backdrop = backdropOf(base);
    this._listen();
  }

  _listen() {
    const { canvas } = this;
    /** @type {PointerEvent | null} */
    let held = null;
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      held = event;
      moved = 0;
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!held) return;
      moved += Math.abs(event.movementX) + Math.abs(event.movementY);
      this.x -= (event.clientX - held.clientX) / this.scale;
      this.y += (event.clientY - held.clientY) / this.scale;
      held = event;
      this.centred = false;
    });
    canvas.addEventListener("pointerup", (event) => {
      held = null;
      if (moved < 5) this._click(event);
    });
    canvas.addEventListener("dblclick", (event) => {
      const at = this.toWorld(event.offsetX, event.offsetY);
      this.actions.look(at.x, at.y);
    });
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const at = this.toWorld(event.offsetX, event.offsetY);
        this.scale = Math.min(Math.max(this.scale * Math.exp(-event.deltaY * 0.0015), 0.1), 40);
        const now = this.toWorld(event.offsetX, event.offsetY);
        this.x += at.x - now.x;
        this.y += at.y - now.y;
      },
      { passive: false },
    );
  }

  /** @param {PointerEvent} event */
  _click(event) {
    const at = this.toWorld(event.offsetX, event.offsetY);
    let best = 0;
    let least = 10 / this.scale;
    for (const [entity, body] of this._bodies ?? []) {
      const away = Math.hypot(body.x - at.x, body.y - at.y) - (KIND_COLOURS[this.actions.kindOf(entity)] ? 0 : 1e9);
      if (away < least) [best, least] = [entity, away];
    }
    if (best) this.actions.select(best);
    else this.actions.place(at);
  }

  /** @param {number} px @param {number} py @returns {{x: number, y: number}} */
  toWorld(px, py) {
    const { clientWidth: w, clientHeight: h } = this.canvas;
    return { x: this.x + (px - w / 2) / this.scale, y: this.y - (py - h / 2) / this.scale };
  }

  /**
   * @param {Map<number, any>} bodies
   * @param {(entity: number) => number} roomOf
   * @param {{selected: number, camera: any, plan: any, happenings: import("./happenings.js").Happening[]}} shown
   */
  draw(bodies, roomOf, shown) {
    this._bodies = bodies;
    const { canvas, context } = this;
    const { clientWidth: w, clientHeight: h } = canvas;
    if (!w || !h) return;
    const ratio = Math.min(devicePixelRatio, 2);
    if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
      canvas.width = Math.round(w * ratio);
      canvas.height = Math.round(h * ratio);
    }
    const { half } = this.base.manifest;
    if (!this.scale) this.scale = Math.min(w, h) / (2 * half);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = "#6f7570";
    context.fillRect(0, 0, w, h);
    context.translate(w / 2 - this.x * this.scale, h / 2 + this.y * this.scale);
    context.scale(this.scale, this.scale);
    context.imageSmoothingEnabled = true;
    context.drawImage(this.backdrop, -half, -half, 2 * half, 2 * half);
    this._happenings(shown.happenings);
    this._camera(shown.camera);
    if (shown.plan?.path?.length > 1) this._path(shown.plan.path);
    for (const [entity, body] of bodies) this._body(entity, body, roomOf(entity), entity === shown.selected);
    this._scaleBar(w, h, ratio);
  }

  /** @param {number} entity @param {any} body @param {number} room @param {boolean} chosen */
  _body(entity, body, room, chosen) {
    const kind = this.actions.kindOf(entity);
    const colour = KIND_COLOURS[kind];
    if (!colour || (kind === "object" && !chosen)) return;
    const { context, scale } = this;
    const vehicle = kind === "car" || kind === "bus" || kind === "tram";
    const size = Math.max(vehicle ? 2 : 0.5, (chosen ? 6 : 3.2) / scale);
    context.save();
    context.translate(body.x, -body.y);
    context.rotate(-body.yaw);
    context.fillStyle = colour;
    context.strokeStyle = chosen ? "#ffb000" : "rgba(255,255,255,0.9)";
    context.lineWidth = (chosen ? 2.5 : 1) / scale;
    context.globalAlpha = room >= 0 ? 0.5 : 1;
    context.beginPath();
    if (vehicle) context.rect(-size, -size * 0.45, 2 * size, 0.9 * size);
    else {
      context.moveTo(1.5 * size, 0);
      context.arc(0, 0, size, 0.7, 2 * Math.PI - 0.7);
      context.closePath();
    }
    context.fill();
    context.stroke();
    context.restore();
  }

  /** @param {any} camera x, y, yaw, half angle, reach */
  _camera(camera) {
    if (!camera) return;
    const { context, scale } = this;
    const reach = Math.min(Math.max(camera.reach, 30 / scale), 400);
    context.save();
    context.translate(camera.x, -camera.y);
    context.rotate(-camera.yaw);
    context.fillStyle = "rgba(255, 176, 0, 0.22)";
    context.strokeStyle = "rgba(255, 176, 0, 0.95)";
    context.lineWidth = 1.5 / scale;
    context.beginPath();
    context.moveTo(0, 0);
    context.arc(0, 0, reach, -camera.half, camera.half);
    context.closePath();
    context.fill();
    context.stroke();
    context.restore();
  }

  /** @param {import("./happenings.js").Happening[]} events */
  _happenings(events) {
    const { context, scale } = this;
    context.lineWidth = 2 / scale;
    context.strokeStyle = "#d55e00";
    context.fillStyle = "rgba(213, 94, 0, 0.25)";
    context.font = `600 ${11 / scale}px system-ui, sans-serif`;
    for (const { x, y, region, text } of events) {
      const [middleX, middleY, radius] = region ?? [x, y, 0];
      context.beginPath();
      context.arc(middleX, -middleY, Math.max(radius, 6 / scale), 0, 2 * Math.PI);
      context.fill();
      context.stroke();
      context.save();
      context.fillStyle = "#7a3500";
      context.strokeStyle = "rgba(255, 255, 255, 0.9)";
      context.lineWidth = 3 / scale;
      const at = /** @type {[number, number]} */ ([middleX + Math.max(radius, 6 / scale) + 3 / scale, -middleY + 4 / scale]);
      context.strokeText(text, ...at);
      context.fillText(text, ...at);
      context.restore();
    }
  }

  /** @param {number[][]} path */
  _path(path) {
    const { context, scale } = this;
    context.strokeStyle = "#00b7d8";
    context.lineWidth = 3 / scale;
    context.beginPath();
    path.forEach(([x, y], k) => (k ? context.lineTo(x, -y) : context.moveTo(x, -y)));
    context.stroke();
  }

  /** @param {number} w @param {number} h @param {number} ratio */
  _scaleBar(w, h, ratio) {
    const { context } = this;
    const metres = [1, 2, 5, 10, 20, 50, 100, 200, 500].find((m) => m * this.scale > 40) ?? 500;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.fillStyle = "rgba(255,255,255,0.85)";
    context.fillRect(8, h - 22, metres * this.scale + 46, 16);
    context.fillStyle = "#222";
    context.fillRect(12, h - 12, metres * this.scale, 3);
    context.font = "11px system-ui, sans-serif";
    context.fillText(`${metres} m`, 16 + metres * this.scale, h - 9);
  }
}

/** @param {import("./ground.js").CityBase} base @returns {HTMLCanvasElement} ground with buildings on it */
function backdropOf({ manifest, picture }) {
  const canvas = document.createElement("canvas");
  canvas.width = picture.width;
  canvas.height = picture.height;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  context.drawImage(picture, 0, 0);
  context.fillStyle = "rgba(255,255,255,0.42)";
  context.fillRect(0, 0, canvas.width, canvas.height);
  const scale = canvas.width / (2 * manifest.half);
  context.translate(canvas.width / 2, canvas.height / 2);
  context.scale(scale, -scale);
  context.fillStyle = "#cfc6b8";
  context.strokeStyle = "#8d8478";
  context.lineWidth = 0.6;
  for (const building of manifest.buildings) {
    context.beginPath();
    building.ring.forEach(([x, y] = [0, 0], /** @type {number} */ k) => (k ? context.lineTo(x, y) : context.moveTo(x, y)));
    context.closePath();
    context.fill();
    context.stroke();
  }
  return canvas;
}
