// Words about people, what they do, and where they are.

/** @param {any} agent @returns {string} */
export function nameOf(agent) {
  return agent.person?.name ?? agent.name;
}

/** @param {any} event */
export function dataOf(event) {
  if (typeof event.data !== "string") return event.data ?? {};
  try {
    return JSON.parse(event.data);
  } catch {
    return {};
  }
}

/**
 * Why nobody heard what was said; "" where somebody did.
 * @param {any} event of kind `message`
 * @returns {string}
 */
export function unheardText(event) {
  const { hearers, missed } = dataOf(event);
  if (!hearers || hearers.length) return "";
  const whys = new Set(Object.values(missed ?? {}));
  if (!whys.size) return "nobody was near enough to hear it";
  return `nobody heard it: ${[...whys].map((why) => (why === "noise" ? "it is too loud here" : "walls are in the way")).join(", ")}`;
}

/** @param {any} action @returns {string} */
export function actionText(action) {
  if (!action) return "nothing";
  if (typeof action === "string") return action;
  const { type, ...rest } = action;
  const details = Object.entries(rest).map(([key, value]) => `${key} ${typeof value === "number" ? Math.round(value * 100) / 100 : JSON.stringify(value)}`);
  return [String(type).replaceAll("_", " "), ...details].join(", ");
}

/** @param {any} text HH:MM:SS, or seconds @returns {number} */
export function secondsOf(text) {
  if (typeof text === "number") return text;
  const [h, m, s] = String(text).split(":").map(Number);
  return h * 3600 + (m || 0) * 60 + (s || 0);
}

/** @param {number[][]} ring @param {number} x @param {number} y */
export function inside(ring, x, y) {
  let odd = false;
  for (let i = 0, j = ring.length - 1; i < ring.length; j = i++) {
    const [xi, yi] = ring[i];
    const [xj, yj] = ring[j];
    if (yi > y !== yj > y && x < ((xj - xi) * (y - yi)) / (yj - yi) + xi) odd = !odd;
  }
  return odd;
}
