// The page: opens the run, draws it, and lets all parts know of each other.

import { Between } from "./between.js";
import { Captions, cameraOnMap, weatherText } from "./captions.js";
import { Charts } from "./charts.js";
import { Clock } from "./clock.js";
import { byId, el, toast } from "./dom.js";
import { loadCityBase } from "./ground.js";
import { Hands } from "./hands.js";
import { goingOn } from "./happenings.js";
import { keyActions } from "./key_actions.js";
import { Keys } from "./keys.js";
import { Log } from "./log.js";
import { CityMap } from "./map.js";
import { Panel } from "./panel.js";
import { Search } from "./search.js";
import { Source } from "./source.js";
import { loadThree } from "./three.js";
import { Timeline } from "./timeline.js";

const MODES = /** @type {[string, string][]} */ ([["orbit", "Orbit"], ["follow", "Follow"], ["first", "First person"], ["bird", "Bird's eye"]]);

class Page {
  constructor() {
    this.source = new Source();
    this.clock = new Clock();
    this.between = new Between();
    /** @type {any} */
    this.view = null;
    this.selected = 0;
    /** @type {{x: number, y: number, z: number} | null} */
    this.spot = null;
    /** @type {any} */
    this.plan = null;
    this.names = true;
    // The parts of the page, made once the run is known.
    /** @type {any} */
    this.timeline = null;
    /** @type {any} */
    this.panel = null;
    /** @type {any} */
    this.log = null;
    /** @type {any} */
    this.charts = null;
    /** @type {any} */
    this.hands = null;
    /** @type {any} */
    this.search = null;
    /** @type {any} */
    this.map = null;
    /** @type {any} */
    this.keys = null;
    /** @type {any} */
    this.pick = null;
    this.captions = new Captions(this.source);
    this._charted = 0;
    this._begun = false;
    /** Whether somebody else draws: stills and films. */
    this.frozen = false;
    this._last = performance.now();
    this._slow = 0;
  }

  async open() {
    const has3d = await loadThree();
    const base = loadCityBase().catch((error) => {
      notice(`The city cannot be drawn: ${error.message}`);
      return null;
    });
    await this.source.reload();
    const { source, clock } = this;
    clock.first = source.timeOf(0);
    clock.last = source.timeOf(source.last);
    clock.time = source.live ? clock.last : clock.first;
    clock.following = source.live;
    clock.playing = !source.live;
    this._build();
    const found = await base;
    if (found) await this._openCity(found, has3d);
    this.keys ??= new Keys(keyActions(this), null);
    byId("loading").hidden = true;
    source.open = async () => {};
    source._connect();
    requestAnimationFrame((now) => this._tick(now));
    if (source.run.you_play) this._play();
  }

  _build() {
    const { source, clock } = this;
    const { run, world } = source.run;
    document.title = `${run.name} – Virtual Community`;
    byId("title").textContent = `${world.name ?? "world"} · ${run.name}`;
    this.timeline = new Timeline(source, clock);
    this.panel = new Panel(source, {
      select: (entity) => this.select(entity),
      follow: (mode) => this.setMode(mode),
      look: (x, y, z) => this.lookAt(x, y, z),
      plan: (plan) => this._setPlan(plan),
    });
    this.log = new Log(this.timeline, (event) => this._goTo(event));
    this.charts = new Charts(byId("metrics"), source);
    this.hands = new Hands(source, { spot: () => this.spot, agent: () => this._agent(this.selected), step: () => this.step, seek: (step) => this.timeline.seek(source.timeOf(step)) });
    this.search = new Search((hit) => this._found(hit));
    for (const tab of document.querySelectorAll("[role=tab]")) tab.addEventListener("click", () => this.openTab(tab.id.slice(4)));
    byId("panel-button").addEventListener("click", () => this.togglePanel());
    byId("map-size").addEventListener("click", () => this.resizeMap());
    source.addEventListener("newest", (/** @type {any} */ { detail }) => clock.arrived(detail.time, performance.now()));
    source.addEventListener("connection", (/** @type {any} */ { detail }) => {
      byId("connection").textContent = detail ? "" : "Connection lost, trying again…";
    });
    source.addEventListener("run", () => {
      toast("The run goes on from another place.");
      this._restart();
    });
    source.addEventListener("cast", (/** @type {any} */ { detail }) => {
      for (const member of detail) this.view?.people.renew(member.entity);
    });
  }

  _restart() {
    const { clock, source } = this;
    clock.last = source.timeOf(source.last);
    clock.time = Math.min(clock.time, clock.last);
    this.timeline.loadEvents();
    this.panel.clear();
  }

  /** @param {import("./ground.js").CityBase} base @param {boolean} has3d */
  async _openCity(base, has3d) {
    byId("attribution").textContent = (base.manifest.attribution ?? []).join(" · ");
    this.map = new CityMap(byId("map"), base, {
      select: (entity) => this.select(entity),
      look: (x, y) => this.lookAt(x, y, undefined),
      place: (at) => this._mark({ ...at, z: this.view ? this.view.groundAt(at) : 0 }),
      kindOf: (entity) => this.source.cast.get(entity)?.kind ?? "",
    });
    if (!has3d) {
      this._flat("For the city in 3D type `vico assets install viewer`, and load this page again. Until then there is the map.");
      return;
    }
    try {
      const { View } = await import("./view.js");
      const { pick } = await import("./picking.js");
      this.view = new View(byId("scene"), this.source);
      await this.view.open(base);
      this.pick = pick;
    } catch (error) {
      console.error(error);
      this._flat(`This browser draws no 3D (${/** @type {Error} */ (error).message}); there is the map.`);
      this.view = null;
      return;
    }
    byId("modes").append(
      ...MODES.map(([mode, text], k) => el("button", { "data-mode": mode, "aria-pressed": String(mode === "orbit"), title: `${text} (${k + 1})`, onclick: () => this.setMode(mode), text })),
    );
    this.view.cameras.onChange = () => {
      for (const button of byId("modes").children) button.setAttribute("aria-pressed", String(button.dataset.mode === this.view.cameras.mode));
    };
    byId("scene").addEventListener("tap", (/** @type {any} */ { detail }) => {
      if (detail.moved < 6 && this.view.cameras.mode !== "play") this._tap(detail.event);
    });
    this.keys = new Keys(keyActions(this), this.view.cameras);
  }

  /** @param {string} text */
  _flat(text) {
    document.body.classList.add("flat");
    notice(text);
  }

  get step() {
    return Math.floor(this.source.stepAt(this.clock.time) + 1e-6);
  }

  /** @param {number} entity */
  _agent(entity) {
    return this.source.run.agents.find((/** @type {any} */ a) => a.entity === entity) ?? null;
  }

  /** @param {number} entity 0 for nobody */
  select(entity) {
    this.selected = entity;
    if (!entity) this.panel.clear();
    else {
      this.panel.show(entity);
      this.openTab("who");
      const body = this.between.bodies.get(entity);
      const { cameras } = this.view ?? {};
      if (body && cameras && cameras.mode !== "follow" && cameras.mode !== "first") cameras.lookAt(body.x, body.y, body.z + 1.2, Math.min(cameras.distance, 12));
      if (body && this.map && !this.view) [this.map.x, this.map.y] = [body.x, body.y];
    }
    this.hands.update();
  }

  /** @param {number} by one on or back among the agents */
  next(by) {
    const agents = this.source.run.agents;
    const at = agents.findIndex((/** @type {any} */ a) => a.entity === this.selected);
    const next = agents[(at + by + agents.length) % agents.length];
    if (next) this.select(next.entity);
  }

  /** @param {string} mode */
  setMode(mode) {
    if (!this.view) return;
    if ((mode === "follow" || mode === "first") && !this.selected) {
      toast("Choose somebody first: click them, or press N.");
      return;
    }
    this.view.cameras.setMode(mode);
    if (mode === "orbit" && this.selected) {
      const body = this.between.bodies.get(this.selected);
      if (body) this.view.cameras.lookAt(body.x, body.y, body.z + 1.2, 14);
    }
  }

  /** @param {number} x @param {number} y @param {number} [z] */
  lookAt(x, y, z) {
    if (this.view) this.view.cameras.lookAt(x, y, (z ?? this.view.groundAt({ x, y })) + 1.2, 45);
    else if (this.map) [this.map.x, this.map.y] = [x, y];
  }

  /** @param {string} name */
  openTab(name) {
    for (const tab of document.querySelectorAll("[role=tab]")) {
      const chosen = tab.id === `tab-${name}`;
      tab.setAttribute("aria-selected", String(chosen));
      byId(tab.getAttribute("aria-controls") ?? "").hidden = !chosen;
    }
    if (name === "metrics") this.charts.update(this.clock.time);
  }

  togglePanel() {
    document.querySelector(".body")?.classList.toggle("plain");
  }

  resizeMap() {
    const { classList } = byId("inset");
    if (classList.contains("large")) classList.replace("large", "away");
    else if (classList.contains("away")) classList.remove("away");
    else classList.add("large");
    if (this.map) this.map.scale = 0;
  }

  /** @param {any} event */
  _goTo(event) {
    this.timeline.seek(event.time);
    const agent = this.source.run.agents.find((/** @type {any} */ a) => a.name === event.agent);
    if (agent) this.select(agent.entity);
    if (Number.isFinite(event.x)) this.lookAt(event.x, event.y, event.z);
  }

  /** @param {any} hit */
  _found(hit) {
    if (hit.what === "event") this.timeline.seek(this.source.timeOf(hit.step));
    if (hit.entity) this.select(hit.entity);
    if (hit.position) this.lookAt(hit.position[0], hit.position[1], hit.position[2]);
  }

  /** @param {PointerEvent} event */
  _tap(event) {
    byId("scene").focus({ preventScroll: true });
    const found = this.pick(this.view, this.between, event.offsetX, event.offsetY);
    if (found.entity) this.select(found.entity);
    else if (found.building) {
      this.selected = 0;
      this.panel.show(0, found.building);
      this.openTab("who");
    } else if (found.spot) this._mark(found.spot);
  }

  /** @param {{x: number, y: number, z: number}} spot */
  _mark(spot) {
    this.spot = spot;
    this.hands.update();
  }

  /** @param {any} plan */
  _setPlan(plan) {
    this.plan = plan;
    this.view?.overlay.setPlan(plan);
  }

  /** @param {number} now */
  _tick(now) {
    if (this.frozen) return;
    const seconds = Math.min((now - this._last) / 1000, 0.5);
    this._last = now;
    const { source, clock, between } = this;
    clock.last = Math.max(clock.last, source.timeOf(source.last));
    clock.held = Boolean(source.run.control?.paused);
    const time = clock.advance(seconds);
    const [before, after, share] = source.around(source.stepAt(time));
    if (before && after) between.set(before, after, share);
    else if (before) between.set(before, before, 0);
    if (before && !this._begun) this._begin();
    if (this.view) this._draw(seconds, now);
    if (now - this._slow > 250) this._update(now);
    this.timeline.update();
    requestAnimationFrame((next) => this._tick(next));
  }

  /** Begin where something is to be seen: at the busiest spot outdoors. */
  _begin() {
    this._begun = true;
    if (!this.view) return;
    const { bodies, before } = this.between;
    /** @type {any[]} */
    const people = [...(before?.people.entity ?? [])].map((e) => bodies.get(e)).filter((b) => b && b.z > this.view.groundAt(b) - 1.5);
    let best = null;
    let most = -1;
    for (const one of people) {
      const near = people.filter((other) => Math.hypot(other.x - one.x, other.y - one.y) < 35).length;
      if (near > most) [best, most] = [one, near];
    }
    if (!best) return;
    this.view.cameras.pitch = 0.3;
    this.view.cameras.lookAt(best.x, best.y, best.z + 2, 38);
  }

  /** Who is followed, as cameras want it; null for nobody. */
  followed() {
    const { between, selected } = this;
    const body = between.bodies.get(selected);
    const member = this.source.cast.get(selected);
    const row = between.before?.rows.agents.get(selected);
    const agents = between.before?.agents;
    if (!body) return null;
    const height = member?.size[2] ?? 1.7;
    if (row === undefined || !agents) return { ...body, entity: selected, height, room: -1, pitch: 0 };
    return { ...body, entity: selected, height, room: agents.room[row], pitch: agents.pitch[row] / 10000 };
  }

  /** @param {number} seconds @param {number} now */
  _draw(seconds, now) {
    const { view, between } = this;
    const followed = this.followed();
    const body = between.bodies.get(this.selected);
    const member = this.source.cast.get(this.selected);
    view.overlay.select(body ? { x: body.x, y: body.y, z: body.z, radius: Math.max(...(member?.size.slice(0, 2) ?? [0.6])) * 0.75 } : this.spot && { ...this.spot, radius: 0.6 });
    view.overlay.setNames([...this.captions.named(view, between, this.selected, this.names), ...(view.happenings.group.visible ? view.happenings.labels() : [])]);
    view.draw(between, seconds, followed, now);
  }

  /** Mark what goes on in the city now. @returns {import("./happenings.js").Happening[]} */
  showHappenings() {
    const found = goingOn(this.timeline.events, this.clock.time);
    if (this.view) {
      this.view.happenings.show(found);
      this.view.vehicles.signals.events = found;
    }
    return found;
  }

  /** @param {number} now */
  _update(now) {
    this._slow = now;
    const { clock, source, between, view } = this;
    this.captions.update(this.timeline.events, clock.time);
    const happenings = this.showHappenings();
    this.panel.update(this.step, clock.time, between.bodies.get(this.selected), source.live && clock.following);
    if (!byId("events").hidden) this.log.update(clock.time);
    if (!byId("metrics").hidden && now - this._charted > 1500) {
      this._charted = now;
      this.charts.update(clock.time);
    }
    if (between.before) byId("weather").textContent = weatherText(between.before.sky);
    this.map?.draw(between.bodies, (/** @type {number} */ entity) => between.before?.agents.room[between.before?.rows.agents.get(entity) ?? -1] ?? -1, {
      selected: this.selected,
      camera: view ? cameraOnMap(view) : null,
      plan: this.plan,
      happenings,
    });
    if (view && !byId("stats").hidden) {
      const { fps, triangles, calls, care } = view.stats;
      byId("stats").textContent = `${fps.toFixed(0)} frames/s · ${(triangles / 1000).toFixed(0)} k triangles · ${calls} calls · care ${care}`;
    }
  }

  async _play() {
    const play = await import("./play.js").catch(() => null);
    if (play) play.start(window.vico);
    else toast("This server lets nobody play.", true);
  }
}

/** @param {string} text */
function notice(text) {
  byId("notice").textContent = text;
  byId("notice").hidden = false;
}

const page = new Page();
/** For the console, for tests, and for the module that lets somebody play. */
/** @type {any} */ (window).vico = {
  page,
  get source() { return page.source; },
  get state() { return page.between; },
  get clock() { return page.clock; },
  get view() { return page.view; },
  get scene() { return page.view?.scene; },
  get camera() { return page.view?.camera; },
  get cameras() { return page.view?.cameras; },
  get keys() { return page.keys; },
  get ui() { return { keys: page.keys, toast, layer: byId("play-layer") }; },
  select: (/** @type {number} */ entity) => page.select(entity),
  stills: () => import("./stills.js"),
};
page.open().catch((error) => {
  console.error(error);
  byId("loading").hidden = true;
  notice(`The run cannot be shown: ${error.message}`);
});
