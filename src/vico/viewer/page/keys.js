// Keys of the page, and the overlay that tells them.

import { byId, el } from "./dom.js";

/** @type {[string, string][]} */
export const KEYS = [
  ["Space", "play or pause"],
  [", and .", "one step back or forward"],
  ["[ and ]", "slower, faster"],
  ["L", "stay with the newest step of a run that goes on"],
  ["1 2 3 4", "orbit, follow, first person, bird's eye"],
  ["W A S D, arrows", "move the camera over the ground"],
  ["Q and E", "turn the camera"],
  ["+ and -", "nearer, farther"],
  ["Click", "choose somebody, a vehicle, a building; mark a spot on the ground"],
  ["Drag, wheel", "turn, zoom; right button or Shift: move"],
  ["F", "follow who is chosen"],
  ["N and P", "next and previous agent"],
  ["T", "names above people"],
  ["M", "map small, large, or away"],
  ["B", "panel beside the picture on or off"],
  ["/", "search"],
  ["Esc", "choose nobody, close what is open"],
  ["?", "this help"],
];

export class Keys {
  /** @param {Record<string, (event: KeyboardEvent) => void>} actions by key @param {{down: Set<string>} | null} cameras */
  constructor(actions, cameras) {
    this.enabled = true;
    this.actions = actions;
    /** What the help tells. */
    this.list = KEYS;
    window.addEventListener("keydown", (event) => {
      if (this.open && event.key === "Escape") {
        event.preventDefault();
        dialog.close();
      }
      if (this.open && event.key !== "?") return;
      if (event.defaultPrevented || !this.enabled || event.ctrlKey || event.metaKey || event.altKey) return;
      const inField = /** @type {any} */ (event.target).closest?.("input, select, textarea, [role=listbox]");
      if (inField && event.key !== "Escape") return;
      // Buttons keep what a keyboard does with them.
      if (event.key === " " && /** @type {any} */ (event.target).closest?.("button, summary")) return;
      cameras?.down.add(event.code);
      const action = actions[event.key] ?? actions[event.key.toLowerCase()];
      if (action) {
        event.preventDefault();
        action(event);
      } else if (event.code.startsWith("Arrow")) event.preventDefault();
    });
    window.addEventListener("keyup", (event) => cameras?.down.delete(event.code));
    window.addEventListener("blur", () => cameras?.down.clear());
    const dialog = byId("help");
    byId("help-close").addEventListener("click", () => dialog.close());
    byId("help-button").addEventListener("click", () => this.help());
  }

  /** Whether the help is shown. */
  get open() {
    return byId("help").open;
  }

  help() {
    const dialog = byId("help");
    if (dialog.open) {
      dialog.close();
      return;
    }
    dialog.querySelector("dl").replaceChildren(...this.list.flatMap(([key, text]) => [el("dt", {}, el("kbd", { text: key })), el("dd", { text })]));
    dialog.showModal();
  }
}
