// What happened, newest first; a click goes there.

import { byId, el } from "./dom.js";
import { clockText } from "./clock.js";

const SHOWN = 120;

export class Log {
  /** @param {import("./timeline.js").Timeline} timeline @param {(event: any) => void} go */
  constructor(timeline, go) {
    this.timeline = timeline;
    this.go = go;
    this.list = byId("log");
    this.filter = byId("log-kind");
    this.filter.addEventListener("change", () => (this._key = ""));
    this._key = "";
  }

  /** @param {number} time */
  update(time) {
    const { events } = this.timeline;
    const kinds = [...new Set(events.map((e) => e.kind))].sort();
    if (this.filter.options.length !== kinds.length + 1) {
      const chosen = this.filter.value;
      this.filter.replaceChildren(el("option", { value: "", text: "All kinds but refusals" }), ...kinds.map((k) => el("option", { value: k, text: k })));
      this.filter.value = kinds.includes(chosen) ? chosen : "";
    }
    const wanted = this.filter.value;
    const shown = events.filter((e) => e.time <= time + 1e-6 && (wanted ? e.kind === wanted : e.kind !== "refused" && e.kind !== "collision")).slice(-SHOWN).reverse();
    const key = `${shown.length} ${shown[0]?.time} ${shown[0]?.text} ${wanted}`;
    if (key === this._key) return;
    this._key = key;
    this.list.replaceChildren(
      ...shown.map((e) => el("li", {}, el("button.person", { onclick: () => this.go(e) }, el("small", { text: `${clockText(e.time)} · ${e.kind} · ${e.agent ?? ""}` }), el("span", { text: e.text || "–" })))),
    );
    if (!shown.length) this.list.replaceChildren(el("li.note", { text: "Nothing yet." }));
  }
}
