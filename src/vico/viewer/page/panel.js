// Who or what is chosen: person, schedule, state, last action, what it sees, what it plans, what was said.

import { byId, el } from "./dom.js";
import { clockText } from "./clock.js";
import { showSight } from "./panel_sight.js";
import { actionText, dataOf, inside, nameOf, secondsOf, unheardText } from "./panel_words.js";
import { getJson } from "./source.js";

const LENSES = [
  ["rgb", "Colour"],
  ["depth", "Depth"],
  ["segmentation", "Segmentation"],
];

export class Panel {
  /**
   * @param {import("./source.js").Source} source
   * @param {{select: (entity: number) => void, follow: (mode: string) => void, look: (x: number, y: number, z: number) => void, plan: (plan: any) => void}} actions
   */
  constructor(source, actions) {
    this.source = source;
    this.actions = actions;
    this.box = byId("who");
    /** @type {any} */
    this.agent = null;
    this.entity = 0;
    this.lens = "rgb";
    /** @type {any[]} */
    this.messages = [];
    this._asked = -1;
    this._said = "";
    /** @type {Record<string, any>} */
    this.parts = {};
    source.addEventListener("log", (/** @type {any} */ { detail }) => {
      this.messages.push(...detail.filter((/** @type {any} */ e) => e.kind === "message" || e.kind === "speech"));
      this._said = "";
    });
    this.clear();
  }

  clear() {
    this.entity = 0;
    this.agent = null;
    this.actions.plan(null);
    const people = this.source.run.agents;
    this.box.replaceChildren(
      el("h2", { text: "Nobody chosen" }),
      el("p.note", { text: "Click somebody in the picture or on the map, press N for the next one, or pick from the list." }),
      el("ul.people", {}, ...people.map((/** @type {any} */ agent) => this._entry(agent))),
    );
  }

  /** @param {any} agent */
  _entry(agent) {
    const what = agent.person ? `${agent.person.occupation ?? ""}, ${agent.person.age}` : (agent.model ?? agent.kind);
    const button = el("button.person", { onclick: () => this.actions.select(agent.entity) }, el("span", { text: nameOf(agent) }), el("small", { text: what }));
    return el("li", {}, button);
  }

  /** @param {number} entity @param {any} [building] */
  show(entity, building) {
    if (building) {
      this._building(building);
      return;
    }
    if (entity === this.entity) return;
    this.entity = entity;
    this.actions.plan(null);
    this._asked = -1;
    this._said = "";
    this.agent = this.source.run.agents.find((/** @type {any} */ a) => a.entity === entity) ?? null;
    const member = this.source.cast.get(entity);
    if (this.agent) this._agent(this.agent);
    else this._body(member, entity);
  }

  /** @param {string} title @param {string} [subtitle] */
  _head(title, subtitle = "") {
    const button = (/** @type {string} */ mode, /** @type {string} */ text, /** @type {string} */ hint) =>
      el("button", { onclick: () => this.actions.follow(mode), title: hint, text });
    return el(
      "header.head",
      {},
      el("h2", { text: title }),
      el("button.close", { onclick: () => this.actions.select(0), "aria-label": "Choose nobody", title: "Choose nobody (Esc)", text: "×" }),
      subtitle && el("p.role", { text: subtitle }),
      el("div.row", {}, button("follow", "Follow", "Stay behind (F)"), button("first", "Through its eyes", "First person (3)"), button("orbit", "Look at", "Turn round it (1)")),
    );
  }

  /** @param {any} agent */
  _agent(agent) {
    const { person } = agent;
    const role = person ? `${person.occupation}, ${person.age}` : (agent.model ?? agent.kind);
    const parts = (this.parts = {
      state: el("dl.state"),
      plan: el("div.plan"),
      picture: el("img", { alt: "", hidden: true }),
      pictureNote: el("p.note"),
      names: el("ul.names"),
      joints: el("div.joints"),
      messages: el("ol.messages"),
      schedule: el("ol.schedule"),
    });
    const lenses = el(
      "div.row.lenses",
      { role: "group", "aria-label": "What it sees" },
      ...LENSES.filter(([key]) => (this.source.run.outputs ?? ["rgb"]).includes(key)).map(([key, text]) =>
        el("button", { "aria-pressed": String(key === this.lens), "data-lens": key, onclick: () => this._look(key), text }),
      ),
    );
    const section = (/** @type {string} */ title, /** @type {boolean} */ open, /** @type {any[]} */ ...children) =>
      el("details", { open }, el("summary", { text: title }), ...children);
    const all = [
      this._head(nameOf(agent), `${agent.name} · ${role}`),
      section("Now", true, parts.state),
      section("Plan", true, parts.plan),
      section("What it sees", true, lenses, el("div.picture", {}, parts.picture), parts.pictureNote, parts.names),
      agent.kind === "robot" && section("Joints and contacts", true, parts.joints),
      section("Messages", true, parts.messages),
      person && section("Schedule", true, parts.schedule),
      person && section("About", false, el("p", { text: person.biography ?? "" }), this._traits(person)),
      agent.relations?.length && section("Knows", false, this._relations(agent)),
    ];
    this.box.replaceChildren(...all.filter(Boolean));
    if (person) this._schedule(person.schedule ?? []);
  }

  /** @param {any} person */
  _traits(person) {
    const list = (/** @type {any} */ value) => (Array.isArray(value) ? value.join(", ") : String(value));
    const rows = ["values", "personality", "hobbies", "lifestyle", "home", "workplace", "groups"].filter((key) => person[key]?.length);
    return el("dl.state", {}, ...rows.flatMap((key) => [el("dt", { text: key }), el("dd", { text: list(person[key]) })]));
  }

  /** @param {any} agent */
  _relations(agent) {
    return el("ul.names", {}, ...agent.relations.map((/** @type {any} */ r) => el("li", {}, el("span", { text: r.name }), el("small", { text: [r.kind, r.note].filter(Boolean).join(", ") }))));
  }

  /** @param {any[]} schedule */
  _schedule(schedule) {
    this.parts.schedule.replaceChildren(
      ...schedule.map((item) =>
        el(
          "li",
          { "data-start": secondsOf(item.start), "data-end": secondsOf(item.end) },
          el("time", { text: `${String(item.start).slice(0, 5)}–${String(item.end).slice(0, 5)}` }),
          el("span", { text: item.activity ?? item.type }),
          item.place && el("small", { text: this._placeName(item.place) }),
        ),
      ),
    );
  }

  /** @param {any} id */
  _placeName(id) {
    const place = this.source.run.world.places?.find((/** @type {any} */ p) => p.id === id || p.name === id);
    return place?.name ?? String(id);
  }

  /** @param {any} member @param {number} entity */
  _body(member, entity) {
    this.parts = { state: el("dl.state") };
    const title = member ? member.name : `entity ${entity}`;
    this.box.replaceChildren(this._head(title, member?.kind ?? ""), this.parts.state);
  }

  /** @param {any} building */
  _building(building) {
    this.entity = 0;
    this.agent = null;
    const places = (this.source.run.world.places ?? []).filter((/** @type {any} */ p) => inside(building.ring, p.x, p.y));
    this.parts = {};
    this.box.replaceChildren(
      el("header.head", {}, el("h2", { text: building.name ?? "Building" }), el("p.role", { text: building.use })),
      el("ul.people", {}, ...places.map((/** @type {any} */ p) => el("li", {}, el("button.person", { onclick: () => this.actions.look(p.x, p.y, p.z) }, el("span", { text: p.name }), el("small", { text: p.kind }))))),
      el("p.note", { text: places.length ? "" : "No named place is in it." }),
    );
  }

  /** @param {string} lens */
  _look(lens) {
    this.lens = lens;
    for (const button of this.box.querySelectorAll("[data-lens]")) button.setAttribute("aria-pressed", String(button.getAttribute("data-lens") === lens));
    this._asked = -1;
  }

  /**
   * Show how somebody is at a step.
   * @param {number} step
   * @param {number} time
   * @param {any} body
   * @param {boolean} newest whether the page follows a run that goes on
   */
  async update(step, time, body, newest) {
    if (!this.entity) return;
    if (!this.agent) {
      if (body && this.parts.state) this._state([["Position", `${body.x.toFixed(1)}, ${body.y.toFixed(1)}, ${body.z.toFixed(1)} m`], ["Speed", `${body.speed.toFixed(1)} m/s`]]);
      return;
    }
    this._mark(time);
    this._talk(time);
    if (step === this._asked) return;
    this._asked = step;
    const { name } = this.agent;
    const entity = this.entity;
    const found = await getJson(`api/moment?step=${step}&agent=${encodeURIComponent(name)}`).catch(() => null);
    const now = found?.agents?.[name];
    if (!now || entity !== this.entity) return;
    this._now(now, body);
    showSight(this, name, step, newest);
  }

  /** @param {any} now @param {any} body */
  _now(now, body) {
    const { world } = this.source.run;
    const where = now.room >= 0 ? `${world.rooms?.[now.room]?.kind ?? "a room"}${now.place >= 0 ? `, ${world.places?.[now.place]?.name ?? ""}` : ""}` : now.place >= 0 ? (world.places?.[now.place]?.name ?? "a place") : "outdoors";
    const held = (now.held ?? []).filter(Boolean).map((/** @type {any} */ h) => h.name ?? h);
    /** @type {[string, string][]} */
    const rows = [
      ["Action", actionText(now.action)],
      ["Outcome", now.reason ? `${now.status}: ${now.reason}` : now.status],
      ["Where", where],
    ];
    const due = this._due();
    if (due) rows.unshift(["Schedule", due]);
    if (this.agent.person || this.agent.kind === "assistant") {
      rows.push(["Motion", [(now.clip ?? "").replaceAll("_", " "), now.posture === "standing" ? "" : now.posture].filter(Boolean).join(", ")], ["Cash", Number(now.cash).toFixed(2)]);
    }
    if (body) rows.push(["Speed", `${body.speed.toFixed(1)} m/s`]);
    if (now.vehicle) rows.push(["Rides", this.source.cast.get(now.vehicle)?.name ?? String(now.vehicle.name ?? now.vehicle)]);
    if (held.length) rows.push(["Holds", held.join(", ")]);
    this._state(rows);
    this._plan(now.plan);
    if (this.parts.joints && this.agent.kind === "robot") this._joints(now);
  }

  /** @returns {string} what the schedule says is on now */
  _due() {
    const item = [...(this.parts.schedule?.children ?? [])].find((li) => li.classList.contains("now"));
    return item ? (item.querySelector("span")?.textContent ?? "") : "";
  }

  /** @param {[string, string][]} rows */
  _state(rows) {
    const key = JSON.stringify(rows);
    if (key === this.parts.state.dataset.key) return;
    this.parts.state.dataset.key = key;
    this.parts.state.replaceChildren(...rows.flatMap(([title, text]) => [el("dt", { text: title }), el("dd", { text })]));
  }

  /** @param {any} plan */
  _plan(plan) {
    this.actions.plan(plan);
    if (!plan) {
      this.parts.plan.replaceChildren(el("p.note", { text: this.source.live ? "It publishes no plan now." : "Plans are not part of a recording." }));
      return;
    }
    const goals = (plan.goals ?? []).map((/** @type {any} */ goal) => el("li", {}, el("span", { text: goal.text ?? goal.label }), goal.place && el("small", { text: goal.place })));
    this.parts.plan.replaceChildren(el("ol", {}, ...goals), plan.why && el("p.note", { text: `Why: ${plan.why}` }));
  }

  /** @param {any} now */
  _joints(now) {
    const names = this.agent.joints ?? [];
    const rows = (now.joints ?? []).map((/** @type {number} */ angle, /** @type {number} */ k) => {
      const turned = Math.atan2(Math.sin(angle), Math.cos(angle));
      return el("tr", {}, el("td", { text: names[k] ?? `joint ${k}` }), el("td", { text: turned.toFixed(2) }), el("td", {}, el("meter", { min: -3.15, max: 3.15, value: turned.toFixed(3), "aria-label": names[k] ?? `joint ${k}` })));
    });
    const contacts = (now.contacts ?? []).map((/** @type {any} */ c) => c.with ?? c);
    this.parts.joints.replaceChildren(
      el("table", {}, el("thead", {}, el("tr", {}, el("th", { text: "joint" }), el("th", { text: "rad" }), el("th"))), el("tbody", {}, ...rows)),
      el("p.note", { text: contacts.length ? `Touches ${contacts.join(", ")}` : "Touches nothing." }),
    );
  }

  /** @param {number} time */
  _mark(time) {
    const second = time % 86400;
    for (const item of this.parts.schedule?.children ?? []) {
      const isNow = Number(item.dataset.start) <= second && second < Number(item.dataset.end);
      item.classList.toggle("now", isNow);
    }
  }

  /** @param {number} time */
  _talk(time) {
    const { name } = this.agent;
    const mine = this.messages.filter((e) => e.time <= time && (e.agent === name || (dataOf(e).hearers ?? []).includes(name))).slice(-12);
    const key = `${name} ${mine.length} ${mine[mine.length - 1]?.time}`;
    if (key === this._said) return;
    this._said = key;
    this.parts.messages.replaceChildren(
      ...mine.map((e) => {
        const unheard = e.agent === name ? unheardText(e) : "";
        return el(e.agent === name ? "li.own" : "li", {}, el("small", { text: `${clockText(e.time)} ${this._title(e.agent)}${unheard && ` · ${unheard}`}` }), el("span", { text: e.text }));
      }),
    );
    if (!mine.length) this.parts.messages.replaceChildren(el("li.note", { text: "Said and heard nothing yet." }));
  }

  /** @param {string} name */
  _title(name) {
    const agent = this.source.run.agents.find((/** @type {any} */ a) => a.name === name);
    return agent ? nameOf(agent) : name;
  }
}
