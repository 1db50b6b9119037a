// What the keys of the page do, but for those that steer the camera.

import { byId } from "./dom.js";

/**
 * @param {any} page
 * @returns {Record<string, (event: KeyboardEvent) => void>}
 */
export function keyActions(page) {
  const zoom = (/** @type {number} */ factor) => page.view?.cameras.zoom(factor);
  return {
    " ": () => page.timeline?.toggle(),
    ",": () => page.timeline?.step(-1),
    ".": () => page.timeline?.step(1),
    "[": () => page.timeline?.changeSpeed(-1),
    "]": () => page.timeline?.changeSpeed(1),
    l: () => page.timeline?.follow(),
    1: () => page.setMode("orbit"),
    2: () => page.setMode("follow"),
    3: () => page.setMode("first"),
    4: () => page.setMode("bird"),
    f: () => page.setMode("follow"),
    n: () => page.next(1),
    p: () => page.next(-1),
    t: () => (page.names = !page.names),
    m: () => page.resizeMap(),
    b: () => page.togglePanel(),
    i: () => (byId("stats").hidden = !byId("stats").hidden),
    "+": () => zoom(0.8),
    "=": () => zoom(0.8),
    "-": () => zoom(1.25),
    "/": () => byId("search").focus(),
    "?": () => page.keys?.help(),
    Escape: () => page.select(0),
  };
}
