// Finds people, places, vehicles and what was said.

import { byId, el } from "./dom.js";
import { getJson } from "./source.js";

export class Search {
  /** @param {(hit: any) => void} go */
  constructor(go) {
    this.go = go;
    this.field = byId("search");
    this.list = byId("hits");
    this._round = 0;
    this.field.addEventListener("input", () => this._ask());
    this.field.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this._key(event));
    this.list.addEventListener("keydown", (/** @type {KeyboardEvent} */ event) => this._key(event));
    document.addEventListener("pointerdown", (event) => {
      if (!this.list.contains(event.target) && event.target !== this.field) this.close();
    });
  }

  close() {
    this.list.replaceChildren();
    this.field.setAttribute("aria-expanded", "false");
  }

  async _ask() {
    const text = this.field.value.trim();
    const round = ++this._round;
    if (!text) {
      this.close();
      return;
    }
    await new Promise((resolve) => setTimeout(resolve, 120));
    if (round !== this._round) return;
    const found = await getJson(`api/search?q=${encodeURIComponent(text)}&limit=12`).catch(() => ({ hits: [] }));
    if (round !== this._round) return;
    this.field.setAttribute("aria-expanded", "true");
    this.list.replaceChildren(
      ...found.hits.map((/** @type {any} */ hit) => el("li", {}, el("button.person", { onclick: () => this._choose(hit) }, el("span", { text: hit.text }), el("small", { text: hit.what === "event" ? `event at step ${hit.step}` : hit.what })))),
    );
    if (!found.hits.length) this.list.replaceChildren(el("li.note", { text: `Nothing is called "${text}".` }));
  }

  /** @param {any} hit */
  _choose(hit) {
    this.close();
    this.field.value = "";
    this.field.blur();
    this.go(hit);
  }

  /** @param {KeyboardEvent} event */
  _key(event) {
    const buttons = [...this.list.querySelectorAll("button")];
    const at = buttons.indexOf(/** @type {any} */ (document.activeElement));
    if (event.key === "ArrowDown" && buttons.length) buttons[Math.min(at + 1, buttons.length - 1)].focus();
    else if (event.key === "ArrowUp" && buttons.length) (at > 0 ? buttons[at - 1] : this.field).focus();
    else if (event.key === "Enter" && at < 0 && buttons.length) buttons[0].click();
    else if (event.key === "Escape") {
      this.close();
      this.field.blur();
    } else return;
    event.preventDefault();
    event.stopPropagation();
  }
}
