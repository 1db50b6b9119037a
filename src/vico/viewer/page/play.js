// Somebody plays: keys, mouse, touch and gamepad become what the server asks for; the own body is drawn where it is
// about to be, and slides to what the server says.

import { el } from "./dom.js";
import { KEYS } from "./keys.js";
import { unheardText } from "./panel_words.js";
import { HELP } from "./play_help.js";
import { Input } from "./play_input.js";
import { Predicted } from "./play_predicted.js";

/** Keys that do something once, and what they do without a hint: `true` asks the server, so that it says why not. */
const ONCE = /** @type {Record<string, string>} */ ({ b: "B", n: "N", m: "M", "<": "<", ">": ">", x: "X", z: "Z", g: "G", l: "L" });

class Play {
  /** @param {any} vico what the page leaves for us */
  constructor(vico) {
    this.vico = vico;
    this.source = vico.source;
    this.name = this.source.run.you_play;
    this.entity = this.source.run.agents.find((/** @type {any} */ a) => a.name === this.name)?.entity ?? 0;
    /** @type {any} */
    this.you = null;
    this.active = false;
    this.eyes = false;
    this.predicted = new Predicted();
    this.input = new Input(vico.view?.cameras?.canvas ?? document.body, () => this.active && !this.vico.ui.keys?.open);
    this.input.onButton = (key) => this._button(key);
    this._last = performance.now();
    this._sent = 0;
    this._seq = 0;
    this._sentKeys = "";
    this._hints = "";
    this._told = "";
    this._build();
    this._listen();
    this.begin();
    requestAnimationFrame((now) => this._tick(now));
  }

  begin() {
    this.active = true;
    this.layer.classList.add("playing");
    document.querySelector(".body")?.classList.add("plain");
    this.vico.cameras?.setMode("play");
    this._lendKeys();
    this.vico.page.selected = 0;
  }

  /** While one plays the keys are the game's, and so is their help. */
  _lendKeys() {
    const { keys } = this.vico.ui;
    if (!keys) return;
    keys.enabled = !this.active;
    keys.list = this.active ? HELP : KEYS;
  }

  /** Let go of everything and give the page its keys back. */
  pause() {
    this.active = false;
    this.input.release();
    this._send(performance.now(), true);
    document.exitPointerLock?.();
    this.layer.classList.remove("playing");
    this._lendKeys();
    const body = this.vico.state.bodies.get(this.entity);
    if (body) this.vico.cameras?.lookAt(body.x, body.y, body.z + 1.2, 20);
  }

  _build() {
    const link = document.createElement("link");
    link.rel = "stylesheet";
    link.href = "page/play.css";
    document.head.append(link);
    this.layer = this.vico.ui.layer;
    this.hints = el("ul.play-hints", { "aria-label": "What can be done here" });
    this.task = el("div.play-task", { hidden: true });
    this.state = el("p.play-state", {});
    this.heard = el("ol.play-heard", { "aria-live": "polite" });
    this.chat = el("input.play-chat", { type: "text", maxlength: 1000, placeholder: "Say something (Enter)", "aria-label": "Say something" });
    this.again = el("button.play-again", { onclick: () => this.begin(), text: "Play" });
    this.layer.append(this.task, this.state, this.heard, this.hints, this.chat, this.again);
    this.chat.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this._chatKey(event));
    this.chat.addEventListener("focus", () => this.input.release());
  }

  _listen() {
    this.source.addEventListener("you", (/** @type {any} */ { detail }) => this._take(detail));
    this.source.addEventListener("events", (/** @type {any} */ { detail }) => detail.events.forEach((/** @type {any} */ event) => this._said(event)));
    const between = this.vico.state;
    const set = between.set.bind(between);
    between.set = (/** @type {any[]} */ ...values) => {
      set(...values);
      if (this.active) this._place();
    };
    window.addEventListener("keydown", (event) => this._key(event));
    window.addEventListener("blur", () => this._letGo());
    document.getElementById("modes")?.addEventListener("click", () => this.pause(), { capture: true });
    document.addEventListener("visibilitychange", () => document.hidden && this._letGo());
    this.source.addEventListener("connection", (/** @type {any} */ { detail }) => {
      if (!detail) this.input.release();
      this._seq = detail ? 0 : this._seq;
    });
  }

  _letGo() {
    this.input.release();
    this._send(performance.now(), true);
  }

  /** @param {KeyboardEvent} event */
  _key(event) {
    if (!this.active || event.defaultPrevented || event.target === this.chat || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.repeat) return;
    const key = event.key;
    const { keys } = this.vico.ui;
    if (key === "?") {
      this._letGo();
      keys?.help();
    } else if (keys?.open) return;
    else if (key === "Escape") this.pause();
    else if (key === "Enter") this.chat.focus();
    else if (key.toLowerCase() === "v") this.eyes = !this.eyes;
    else {
      const arm = this.you?.kind === "arm" && "lz".includes(key.toLowerCase());
      const once = ONCE[key] ?? ONCE[key.toLowerCase()];
      if (once && !arm) this._once(once);
      else return;
    }
    event.preventDefault();
  }

  /** @param {KeyboardEvent} event */
  _chatKey(event) {
    event.stopPropagation();
    if (event.key === "Escape") this.chat.blur();
    if (event.key !== "Enter") return;
    const text = this.chat.value.trim();
    this.chat.value = "";
    this.chat.blur();
    if (text) this.do({ type: "communicate", text });
  }

  /** Do what a button of the gamepad stands for. @param {string} key a key, or `first` for the first hint */
  _button(key) {
    const first = this.you?.hints?.find((/** @type {any} */ h) => h.key !== "Enter");
    if (key !== "first") this._once(key);
    else if (first) this.do(first.action);
  }

  /** Do what a key stands for here; without a hint, ask for the plain thing, and be told why not. @param {string} key */
  _once(key) {
    const hint = this.you?.hints?.find((/** @type {any} */ h) => h.key === key);
    if (hint) return this.do(hint.action);
    const { vehicle, room, held } = this.you ?? {};
    const full = held?.[1] ? 1 : 0;
    const plain = /** @type {Record<string, any>} */ ({
      M: { type: vehicle === "bus" ? "exit_bus" : "enter_bus" },
      "<": { type: vehicle === "bike" ? "exit_bike" : "enter_bike" },
      ">": room >= 0 ? { type: "exit" } : null,
      N: { type: "put", hand: full },
      X: { type: this.you?.posture === "sitting" ? "stand" : "sit" },
      Z: { type: this.you?.posture === "lying" ? "wake" : "sleep" },
    })[key];
    if (plain) return this.do(plain);
    const why = /** @type {Record<string, string>} */ ({ B: "Nothing to pick up within reach.", ">": "No door within 2 m.", G: "Nobody near to give it to." });
    this.vico.ui.toast(why[key] ?? "That can't be done here.", true);
    return Promise.resolve();
  }

  /** @param {any} action */
  async do(action) {
    const { source } = this;
    const id = source._id++;
    const reply = await new Promise((resolve) => {
      source._waiting.set(id, resolve);
      source.send({ type: "do", id, action });
    });
    if (!reply.ok) this.vico.ui.toast(reply.error || reply.status, true);
    return reply;
  }

  /** @param {any} you */
  _take(you) {
    this.you = you;
    this.predicted.correct(you, performance.now());
    const hints = JSON.stringify(you.hints);
    if (hints !== this._hints) {
      this._hints = hints;
      const seen = new Set();
      this.hints.replaceChildren(
        ...you.hints.map((/** @type {any} */ h) => {
          const first = !seen.has(h.key);
          seen.add(h.key);
          const press = h.key === "Enter" ? () => this.chat.focus() : () => this.do(h.action);
          return el("li", {}, el("button", { onclick: press }, el("kbd", { text: first ? h.key : "·" }), el("span", { text: h.text })));
        }),
      );
    }
    const held = (you.held ?? []).filter(Boolean).map((/** @type {any} */ h) => h.name);
    const where = you.place || (you.room >= 0 ? "indoors" : "");
    this.state.textContent = [this.name, where, you.vehicle, you.posture === "standing" ? "" : you.posture, held.length ? `holds ${held.join(", ")}` : "", you.reason]
      .filter(Boolean)
      .join(" · ");
    for (const said of you.heard ?? []) this._line(`${this._called(said.speaker)}: ${said.text}`);
    if (you.task) this._task(you.task);
  }

  /** Show what the own person said, and say so where nobody heard it. @param {any} event */
  _said(event) {
    if (event.kind !== "message" || event.agent !== this.name) return;
    const unheard = unheardText(event);
    this._line(`You: ${event.text}${unheard && ` (${unheard})`}`);
    if (unheard) this.vico.ui.toast(`${unheard[0].toUpperCase()}${unheard.slice(1)}.`, true);
  }

  /** @param {string} text said or heard */
  _line(text) {
    this.heard.append(el("li", { text }));
    while (this.heard.children.length > 6) this.heard.firstChild.remove();
  }

  /** @param {string} name */
  _called(name) {
    return this.source.run.agents.find((/** @type {any} */ a) => a.name === name)?.person?.name ?? name;
  }

  /** @param {any} task */
  _task(task) {
    this.task.hidden = false;
    const left = Math.ceil(task.seconds_left);
    const clock = `${Math.floor(left / 60)}:${String(left % 60).padStart(2, "0")}`;
    const text = JSON.stringify([task.subtasks, clock]);
    if (text === this._told) return;
    this._told = text;
    this.task.replaceChildren(
      el("p", {}, el("b", { text: task.instruction }), el("span", { text: `${clock} left` })),
      el(
        "ol",
        {},
        ...task.subtasks.map((/** @type {any} */ one) =>
          el("li", { class: one.done ? "done" : undefined }, el("span", { text: one.text }), !one.done && el("button", { onclick: () => this.do({ type: "task_complete", index: one.index }), title: "Say that this is done", text: "Report" })),
        ),
      ),
    );
  }

  /** @param {number} now */
  _tick(now) {
    const seconds = Math.min((now - this._last) / 1000, 0.1);
    this._last = now;
    if (this.active) {
      const state = this.input.read(seconds, this.predicted.yaw);
      this.predicted.advance(seconds, state, this.you, now);
      this._send(now, false);
      this._camera(seconds);
    }
    requestAnimationFrame((again) => this._tick(again));
  }

  /** @param {number} now @param {boolean} letGo */
  _send(now, letGo) {
    const state = this.input.message();
    const text = JSON.stringify([state.down, state.axes, Math.round((state.yaw ?? 0) * 50)]);
    const idle = !state.down.length && !Object.keys(state.axes).length;
    const late = now - this._sent > (idle ? 1000 : 200);
    if (!letGo && !late && (text === this._sentKeys || now - this._sent < 30)) return;
    this._sentKeys = text;
    this._sent = now;
    this._seq++;
    this.source.send({ type: "keys", seq: this._seq, ...state });
  }

  /** Draw the own body where it is about to be. */
  _place() {
    const body = this.vico.state.bodies.get(this.entity);
    if (!body || !this.predicted.rules(this.you)) return;
    body.x = this.predicted.x;
    body.y = this.predicted.y;
    body.z = this.predicted.z;
    body.yaw = this.predicted.yaw;
  }

  /** @param {number} seconds */
  _camera(seconds) {
    const { camera, cameras, state } = this.vico;
    const body = state.bodies.get(this.entity);
    if (!camera || !body) return;
    // The page shows the city from afar when its first frame comes.
    if (cameras.mode !== "play") cameras.setMode("play");
    const { input } = this;
    if (!input.looks) {
      // Keys turn the body: the camera comes round behind it.
      const turn = Math.atan2(Math.sin(body.yaw - input.yaw), Math.cos(body.yaw - input.yaw));
      input.yaw += turn * (1 - Math.exp(-4 * seconds));
    }
    const height = this.you?.kind === "person" ? 1.55 : 0.6;
    const ahead = { x: Math.cos(input.yaw) * Math.cos(input.pitch), y: Math.sin(input.yaw) * Math.cos(input.pitch), z: Math.sin(input.pitch) };
    const eye = { x: body.x, y: body.y, z: body.z + height };
    let back = this.eyes ? -0.15 : this.you?.room >= 0 ? 1.8 : this.you?.kind === "person" ? 3.4 : 4.5;
    const Vector = camera.position.constructor;
    const from = new Vector(eye.x, eye.y, eye.z);
    if (back > 0) {
      const way = new Vector(-ahead.x, -ahead.y, -ahead.z);
      back = Math.max(0.4, Math.min(back, cameras.sight(from, way, back) - 0.25));
    }
    camera.position.set(eye.x - ahead.x * back, eye.y - ahead.y * back, eye.z - ahead.z * back + (this.eyes ? 0 : 0.35));
    if (!(this.you?.room >= 0)) camera.position.z = Math.max(camera.position.z, cameras.groundAt(camera.position) + 0.25);
    camera.lookAt(eye.x + ahead.x * 4, eye.y + ahead.y * 4, eye.z + ahead.z * 4);
  }
}

/** @param {any} vico @returns {Play} */
export function start(vico) {
  const play = new Play(vico);
  vico.play = play;
  return play;
}
