// Time: play and pause, steps, speed, where in the run one is, and marks of what happened.

import { byId, el } from "./dom.js";
import { clockText } from "./clock.js";
import { getJson } from "./source.js";

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8, 16, 60];
/** @type {Record<string, string>} */
const MARKS = { message: "#0072b2", speech: "#0072b2", collision: "#d55e00", refused: "#b8b8b8" };
const OTHER = "#009e73";
const BOOKMARK = "#e0a100";
/** A click so near a bookmark goes to it, pixels. */
const NEAR_MARK = 7;

export class Timeline {
  /** @param {import("./source.js").Source} source @param {import("./clock.js").Clock} clock */
  constructor(source, clock) {
    this.source = source;
    this.clock = clock;
    /** @type {any[]} */
    this.events = [];
    this._drawn = "";
    this.play = byId("play");
    this.slider = byId("seek");
    this.text = byId("time");
    this.speed = byId("speed");
    this.marks = byId("marks");
    for (const value of SPEEDS) this.speed.append(el("option", { value: String(value), text: `${value}x` }));
    this.speed.value = "1";
    this.play.addEventListener("click", () => this.toggle());
    byId("back").addEventListener("click", () => this.step(-1));
    byId("forward").addEventListener("click", () => this.step(1));
    byId("live").addEventListener("click", () => this.follow());
    this.speed.addEventListener("change", () => this.setSpeed(Number(this.speed.value)));
    this.slider.addEventListener("input", () => this.seek(source.timeOf(Number(this.slider.value))));
    this.marks.addEventListener("click", (/** @type {MouseEvent} */ event) => {
      const share = event.offsetX / this.marks.clientWidth;
      this.seek(source.timeOf(this._bookmarkAt(event.offsetX)?.step ?? Math.round(share * source.last)));
    });
    this.marks.addEventListener("mousemove", (/** @type {MouseEvent} */ event) => {
      const mark = this._bookmarkAt(event.offsetX);
      this.marks.title = mark ? `${mark.text || "bookmark"}, ${clockText(mark.time)}` : "";
    });
    byId("live").hidden = !source.live;
    source.addEventListener("events", (/** @type {any} */ { detail }) => this._take(detail.events));
    source.addEventListener("control", () => this._control());
    /** Resolves when what happened before the page was opened is known. */
    this.loaded = this.loadEvents();
  }

  /** What was bookmarked. @returns {{step: number, time: number, text: string}[]} */
  get bookmarks() {
    return this.source.run.bookmarks ?? [];
  }

  /** @param {number} step @returns {number} where it is along the marks, pixels */
  _across(step) {
    return (step / Math.max(this.source.last, 1)) * (this.marks.clientWidth - 2);
  }

  /** @param {number} x pixels along the marks */
  _bookmarkAt(x) {
    const away = (/** @type {any} */ mark) => Math.abs(this._across(mark.step) - x);
    return this.bookmarks.filter((mark) => away(mark) <= NEAR_MARK).sort((a, b) => away(a) - away(b))[0];
  }

  async loadEvents() {
    let first = 0;
    this.events = [];
    // As many as a page can show; the newest of a long run come by themselves.
    for (let k = 0; k < 20; k++) {
      const found = await getJson(`api/events?first=${first}&last=${this.source.last}&limit=1000`).catch(() => null);
      if (!found) return;
      this._take(found.events);
      if (!found.more || !found.events.length) return;
      first = found.events[found.events.length - 1].step + 1;
    }
  }

  /** @param {any[]} events */
  _take(events) {
    this.events.push(...events);
    this._drawn = "";
    this.source.dispatchEvent(new CustomEvent("log", { detail: events }));
  }

  /** Whether the run itself is told, not only what is shown of it. */
  get leads() {
    return this.clock.following && this.source.can("pause");
  }

  toggle() {
    if (this.leads) {
      this.source.command(this.source.run.control.paused ? "resume" : "pause");
      return;
    }
    if (!this.clock.playing && this.clock.time >= this.clock.last - 1e-6) this.clock.time = this.clock.first;
    this.clock.playing = !this.clock.playing;
  }

  /** @param {number} by steps */
  step(by) {
    if (this.leads && by > 0) {
      this.source.command("step", { steps: 1 });
      return;
    }
    this.clock.playing = false;
    const place = this.source.stepAt(this.clock.time);
    const step = by > 0 ? Math.floor(place + 1e-6) + 1 : Math.ceil(place - 1e-6) - 1;
    this.seek(this.source.timeOf(Math.min(Math.max(step, 0), this.source.last)));
  }

  /** @param {number} value */
  setSpeed(value) {
    this.clock.speed = value;
    this.speed.value = String(value);
    if (this.clock.following && this.source.can("speed")) this.source.command("speed", { factor: value });
  }

  /** @param {number} by one up or down */
  changeSpeed(by) {
    const at = SPEEDS.indexOf(this.clock.speed);
    this.setSpeed(SPEEDS[Math.min(Math.max((at < 0 ? 3 : at) + by, 0), SPEEDS.length - 1)]);
  }

  /** @param {number} time */
  seek(time) {
    this.clock.seek(time);
  }

  follow() {
    if (this.source.live) this.clock.following = true;
  }

  _control() {
    const { control } = this.source.run;
    byId("live").title = control?.status ?? "";
  }

  update() {
    const { clock, source } = this;
    const { control } = source.run;
    const runs = this.leads ? !control?.paused : clock.playing;
    const label = runs ? "Pause" : "Play";
    if (this.play.ariaLabel !== label) {
      this.play.ariaLabel = label;
      this.play.title = `${label} (space)`;
      this.play.classList.toggle("runs", runs);
    }
    this.slider.max = String(source.last);
    const place = source.stepAt(clock.time);
    if (document.activeElement !== this.slider || clock.playing) this.slider.value = String(place);
    this.slider.ariaValueText = clockText(clock.time);
    const text = clockText(clock.time);
    if (this.text.textContent !== text) this.text.textContent = text;
    byId("step").textContent = `step ${Math.floor(place + 1e-6)} / ${source.last}`;
    byId("live").classList.toggle("on", clock.following);
    this._draw();
  }

  _draw() {
    const { marks, source } = this;
    const key = `${this.events.length} ${source.last} ${marks.clientWidth} ${this.bookmarks.length}`;
    if (key === this._drawn || !marks.clientWidth) return;
    this._drawn = key;
    marks.width = marks.clientWidth;
    marks.height = marks.clientHeight;
    const context = /** @type {CanvasRenderingContext2D} */ (marks.getContext("2d"));
    context.clearRect(0, 0, marks.width, marks.height);
    for (const event of this.events) {
      const quiet = event.kind === "refused" || event.kind === "collision";
      context.fillStyle = MARKS[event.kind] ?? OTHER;
      context.fillRect(this._across(event.step), quiet ? marks.height * 0.6 : 0, 2, marks.height);
    }
    context.fillStyle = BOOKMARK;
    for (const { step } of this.bookmarks) {
      const x = this._across(step) + 1;
      context.fillRect(x - 1, 0, 2, marks.height);
      context.beginPath();
      context.moveTo(x, 0);
      context.lineTo(x + 7, 3.5);
      context.lineTo(x, 7);
      context.fill();
    }
  }
}
