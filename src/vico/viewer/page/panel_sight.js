// What somebody sees, in the panel: colour, depth, or segmentation with names.

import { el } from "./dom.js";
import { getJson } from "./source.js";

/**
 * Show what an agent sees at a step, while it stays chosen.
 * @param {import("./panel.js").Panel} panel
 * @param {string} name
 * @param {number} step
 * @param {boolean} newest whether the page follows a run that goes on: then what is seen now is asked for
 */
export async function showSight(panel, name, step, newest) {
  const { entity, lens } = panel;
  const { picture, pictureNote, names } = panel.parts;
  const live = newest ? "" : `&step=${step}`;
  const answer = await fetch(`api/view?agent=${encodeURIComponent(name)}${live}&output=${lens}`).catch(() => null);
  if (entity !== panel.entity || picture !== panel.parts.picture) return;
  if (!answer?.ok || answer.headers.get("Content-Type") === "application/json") {
    picture.hidden = true;
    names.replaceChildren();
    const why = await answer?.json().catch(() => null);
    pictureNote.textContent = why?.reason ?? why?.error ?? "There is no picture of this step.";
    return;
  }
  const old = picture.src;
  picture.src = URL.createObjectURL(await answer.blob());
  picture.alt = `${lens} seen by ${name}`;
  picture.hidden = false;
  pictureNote.textContent = answer.headers.get("X-Depth") ? "Near is light." : "";
  if (old.startsWith("blob:")) URL.revokeObjectURL(old);
  if (lens !== "segmentation") {
    names.replaceChildren();
    return;
  }
  const found = await getJson(`api/view?agent=${encodeURIComponent(name)}${live}&output=names`).catch(() => ({ names: [] }));
  if (picture !== panel.parts.picture) return;
  names.replaceChildren(
    ...found.names.slice(0, 14).map((/** @type {any} */ n) => el("li", {}, el("i", { style: `background: rgb(${n.colour.join(",")})` }), el("span", { text: n.name }), el("small", { text: n.kind }))),
  );
}
