// Counts over time, as small charts.

import { el } from "./dom.js";
import { clockText } from "./clock.js";
import { getJson } from "./source.js";

/** @type {[string, string, string][]} */
const SERIES = [
  ["arrivals", "Arrivals", "#0072b2"],
  ["late", "Late arrivals", "#d55e00"],
  ["collisions", "Collisions", "#cc79a7"],
  ["refused", "Refused actions", "#7f7f7f"],
];

export class Charts {
  /** @param {HTMLElement} parent @param {import("./source.js").Source} source */
  constructor(parent, source) {
    this.source = source;
    this.boxes = SERIES.map(([key, title, colour]) => {
      const value = el("strong", { text: "–" });
      const canvas = el("canvas", { role: "img", "aria-label": `${title} over time` });
      parent.append(el("figure.chart", {}, el("figcaption", {}, el("span", { text: title }), value), canvas));
      return { key, colour, value, canvas };
    });
    this.note = el("p.note");
    parent.append(this.note);
  }

  /** @param {number} time */
  async update(time) {
    const found = await getJson(`api/metrics?first=0&last=${this.source.last}&points=300`).catch(() => null);
    if (!found) return;
    this.note.textContent =
      found.speed !== undefined && found.speed !== null ? `${found.speed.toFixed(1)} simulated seconds a second` : "Counts since the start of the run.";
    for (const box of this.boxes) this._draw(box, found, time);
  }

  /** @param {any} box @param {any} found @param {number} now */
  _draw({ key, colour, value, canvas }, found, now) {
    const y = found[key] ?? [];
    const x = found.time;
    let k = 0;
    while (k + 1 < x.length && x[k + 1] <= now) k++;
    value.textContent = String(y[k] ?? "–");
    const ratio = Math.min(devicePixelRatio, 2);
    const w = canvas.clientWidth;
    const h = canvas.clientHeight;
    if (!w) return;
    canvas.width = w * ratio;
    canvas.height = h * ratio;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const most = Math.max(1, ...y);
    const px = (/** @type {number} */ t) => 2 + ((t - x[0]) / Math.max(x[x.length - 1] - x[0], 1)) * (w - 4);
    const py = (/** @type {number} */ v) => h - 14 - (v / most) * (h - 26);
    context.strokeStyle = colour;
    context.lineWidth = 1.8;
    context.beginPath();
    x.forEach((/** @type {number} */ t, /** @type {number} */ i) => (i ? context.lineTo(px(t), py(y[i])) : context.moveTo(px(t), py(y[i]))));
    context.stroke();
    const ink = getComputedStyle(canvas).color;
    context.fillStyle = ink;
    context.strokeStyle = ink;
    context.lineWidth = 0.6;
    context.beginPath();
    context.moveTo(px(now), 4);
    context.lineTo(px(now), h - 13);
    context.stroke();
    context.font = "10px system-ui, sans-serif";
    context.fillText(String(most), 2, 9);
    context.fillText(clockText(x[0]).slice(0, 5), 2, h - 2);
    context.textAlign = "right";
    context.fillText(clockText(x[x.length - 1]).slice(0, 5), w - 2, h - 2);
  }
}
