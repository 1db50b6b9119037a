// Hands in a run that goes on: what the server says it can do, as buttons and short forms.

import { clockText } from "./clock.js";
import { byId, el, toast } from "./dom.js";

/**
 * @typedef {object} Here what a command may be about
 * @property {() => {x: number, y: number, z: number} | null} spot the marked spot
 * @property {() => any} agent who is chosen
 * @property {() => number} step
 * @property {(step: number) => void} seek
 */

export class Hands {
  /** @param {import("./source.js").Source} source @param {Here} here */
  constructor(source, here) {
    this.source = source;
    this.here = here;
    this.box = byId("hands");
    this.tab = byId("tab-hands");
    this._shown = "";
    for (const name of ["control", "connection", "run"]) source.addEventListener(name, () => this.build());
    this.build();
  }

  build() {
    const can = this.source.connected ? (this.source.run.control?.can ?? []) : [];
    const key = JSON.stringify([can, this.source.run.run?.identity]);
    if (key === this._shown) return;
    this._shown = key;
    this.tab.hidden = !can.length;
    const has = (/** @type {string} */ name) => can.includes(name);
    const { run } = this.source;
    const option = (/** @type {string} */ value) => el("option", { value, text: value.replaceAll("_", " ") });
    this.spotText = el("p.note");
    this.whoText = el("p.note");
    this.box.replaceChildren(
      ...[
        this.spotText,
        has("weather") && this._form("Weather", "weather", [["kind", el("select", {}, ...(run.weather_kinds ?? []).map(option))], ["over", number(300), "seconds until it is so"]]),
        has("close_road") && this._form("Close the road here", "close_road", [["radius", number(15), "metres"], ["minutes", number(60), "minutes"]], { spot: 2 }),
        has("event") && this._form("Start an event here", "event", [["kind", el("select", {}, ...(run.event_kinds ?? []).map(option))], ["name", el("input", { type: "text", placeholder: "name" })], ["radius", number(20), "metres"], ["minutes", number(60), "minutes"]], { spot: 2 }),
        has("drop") && this._form("Drop a thing here", "drop", [["kind", this._things()]], { spot: 3 }),
        this.whoText,
        has("say") && this._form("Say something to who is chosen", "say", [["text", el("input", { type: "text", placeholder: "Good morning!", required: true })]], { agent: "any" }),
        has("goal") && this._form("Send the chosen robot to the marked spot", "goal", [], { agent: "robot", spot: 3 }),
        has("bookmark") && this._form("Bookmark this step", "bookmark", [["text", el("input", { type: "text", placeholder: "what is there to see" })]], { step: true }),
        has("bookmarks") && this._bookmarks(),
        has("snapshot") && this._form("Keep the state (snapshot)", "snapshot", [["name", el("input", { type: "text", placeholder: "name" })]]),
        has("branch") && this._form("What if: go on in a copy from here", "branch", [["name", el("input", { type: "text", placeholder: "what-if", required: true })]], { step: true }),
        has("back") && this._form("Go back to the checkpoint before here", "back", [], { step: true }),
        has("stop") && this._form("End the run", "stop", []),
      ].filter(Boolean),
    );
    this.update();
  }

  /** A list of what was bookmarked; a click goes there. */
  _bookmarks() {
    this.list = el("ul.people");
    this.source.command("bookmarks").then((reply) => this._mark(reply));
    return this.list;
  }

  /** @param {any} reply of a command that tells bookmarks */
  _mark(reply) {
    if (!reply.bookmarks || !this.list) return;
    this.list.replaceChildren(
      ...reply.bookmarks.map((/** @type {any} */ mark) => el("li", {}, el("button.person", { onclick: () => this.here.seek(mark.step) }, el("span", { text: mark.text || `step ${mark.step}` }), el("small", { text: clockText(mark.time) })))),
    );
  }

  _things() {
    const select = el("select");
    this.source.command("things").then((reply) => {
      select.replaceChildren(...(reply.things ?? ["backpack"]).slice(0, 400).map((/** @type {string} */ t) => el("option", { value: t, text: t.replaceAll("_", " ") })));
    });
    return select;
  }

  /**
   * @param {string} title
   * @param {string} command
   * @param {any[]} fields name, input and what its number is
   * @param {{spot?: number, agent?: string, step?: boolean}} [needs]
   */
  _form(title, command, fields, needs = {}) {
    const inputs = fields.map(([name, input, unit]) => {
      input.name = name;
      return el("label", {}, el("span", { text: unit ?? name }), input);
    });
    const button = el("button.go", { type: "submit", text: title });
    const submit = async (/** @type {SubmitEvent} */ event) => {
      event.preventDefault();
      const values = this._values(fields, needs);
      if (typeof values === "string") {
        toast(values, true);
        return;
      }
      button.disabled = true;
      const reply = await this.source.command(command, values);
      button.disabled = false;
      this._mark(reply);
      toast(reply.ok ? `${title}: done` : (reply.error ?? "it was refused"), !reply.ok);
    };
    return el("form.hand", { onsubmit: submit }, ...inputs, button);
  }

  /** @param {any[]} fields @param {{spot?: number, agent?: string, step?: boolean}} needs @returns {any} arguments, or what is missing */
  _values(fields, needs) {
    /** @type {Record<string, any>} */
    const values = {};
    for (const [name, input] of fields) {
      if (input.value !== "") values[name] = input.type === "number" ? Number(input.value) : input.value;
    }
    if (needs.spot) {
      const spot = this.here.spot();
      if (!spot) return "Mark a spot first: click the ground in the picture, or a place on the map.";
      values.position = [spot.x, spot.y, spot.z].slice(0, needs.spot);
    }
    if (needs.agent) {
      const agent = this.here.agent();
      if (!agent || (needs.agent === "robot" && agent.kind !== "robot")) return needs.agent === "robot" ? "Choose a robot first." : "Choose somebody first.";
      values.agent = agent.name;
    }
    if (needs.step) values.step = this.here.step();
    return values;
  }

  update() {
    const spot = this.here.spot();
    const agent = this.here.agent();
    if (this.spotText) this.spotText.textContent = spot ? `Marked spot: ${spot.x.toFixed(1)}, ${spot.y.toFixed(1)} m` : "No spot is marked: click the ground or the map.";
    if (this.whoText) this.whoText.textContent = agent ? `Chosen: ${agent.person?.name ?? agent.name}` : "Nobody is chosen.";
  }
}

/** @param {number} value */
function number(value) {
  return el("input", { type: "number", value: String(value), min: "0", step: "any" });
}
