// Small helpers to build the page.

/**
 * Make an element.
 * @param {string} tag with classes after dots: "button.wide"
 * @param {Record<string, any>} [properties] attributes; those that begin with "on" are listeners
 * @param {...(Node | string | null | undefined | false)} children
 * @returns {any}
 */
export function el(tag, properties = {}, ...children) {
  const [name, ...classes] = tag.split(".");
  const element = document.createElement(name);
  element.classList.add(...classes);
  for (const [key, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
    else if (key === "text") element.textContent = value;
    else if (key === "value") /** @type {any} */ (element).value = value;
    else element.setAttribute(key, value === true ? "" : String(value));
  }
  for (const child of children) if (child) element.append(child);
  return element;
}

/** @param {string} id @returns {any} */
export function byId(id) {
  const element = document.getElementById(id);
  if (!element) throw new Error(`the page lacks #${id}`);
  return element;
}

/** @type {any} */
let toastTimer = 0;

/** Say something for a few seconds. @param {string} text @param {boolean} [bad] */
export function toast(text, bad = false) {
  const box = byId("toast");
  box.textContent = text;
  box.className = bad ? "toast shown bad" : "toast shown";
  clearTimeout(toastTimer);
  toastTimer = setTimeout(() => (box.className = "toast"), bad ? 7000 : 3500);
}

/** Colours of kinds of bodies that colour-blind readers tell apart (Okabe and Ito). */
export const KIND_COLOURS = /** @type {Record<string, string>} */ ({
  resident: "#d55e00",
  assistant: "#cc79a7",
  robot: "#009e73",
  car: "#0072b2",
  bus: "#0072b2",
  tram: "#0072b2",
  pedestrian: "#8a8a8a",
  cyclist: "#56b4e9",
  bicycle: "#56b4e9",
  object: "#e69f00",
  fixture: "#e69f00",
});
