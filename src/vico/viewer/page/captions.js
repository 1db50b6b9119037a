// What is written over the picture and beside it: names, what is being said, the weather, where one looks from.

import { nameOf, unheardText } from "./panel_words.js";

/** Names are shown above people within so many metres, and messages for so many seconds. */
const NAMED_WITHIN = 60;
const SPOKEN_FOR = 6;

export class Captions {
  /** @param {import("./source.js").Source} source */
  constructor(source) {
    this.source = source;
    /** @type {Map<string, string>} what is being said, by who says it */
    this._talking = new Map();
  }

  /** @param {any[]} events @param {number} time */
  update(events, time) {
    this._talking = new Map();
    for (const event of events) {
      if ((event.kind === "message" || event.kind === "speech") && event.time <= time && event.time > time - SPOKEN_FOR) this._talking.set(event.agent, `“${event.text}”${unheardText(event) && " (nobody heard it)"}`);
    }
  }

  /**
   * @param {any} view
   * @param {import("./between.js").Between} between
   * @param {number} selected
   * @param {boolean} everybody whether not only who is chosen is named
   */
  named(view, between, selected, everybody) {
    /** @type {any[]} */
    const named = [];
    const { x, y, z } = view.camera.position;
    for (const agent of this.source.run.agents) {
      const body = between.bodies.get(agent.entity);
      if (!body) continue;
      const chosen = agent.entity === selected;
      const away = Math.hypot(body.x - x, body.y - y, body.z - z);
      if (!chosen && (!everybody || away > NAMED_WITHIN)) continue;
      if (body.z < view.groundAt(body) - 2 && !chosen) continue;
      if (chosen && view.cameras.mode === "first") continue;
      const height = this.source.cast.get(agent.entity)?.size[2] ?? 1.7;
      named.push({ entity: agent.entity, text: this._spoken(agent) ?? nameOf(agent), x: body.x, y: body.y, z: body.z + height + 0.25, chosen });
    }
    return named;
  }

  /** @param {any} agent @returns {string | null} what somebody says now */
  _spoken(agent) {
    const said = this._talking.get(agent.name);
    return said ? `${nameOf(agent)}: ${said}` : null;
  }
}

/** @param {any} view */
export function cameraOnMap(view) {
  const { position, fov, aspect } = view.camera;
  const { target } = view.cameras;
  const way = view.camera.getWorldDirection(target.clone());
  return { x: position.x, y: position.y, yaw: Math.atan2(way.y, way.x), half: Math.atan(Math.tan((fov * Math.PI) / 360) * aspect), reach: Math.hypot(target.x - position.x, target.y - position.y) * 1.4 };
}

/** @param {Float32Array} sky @returns {string} */
export function weatherText(sky) {
  if (!Number.isFinite(sky[4])) return "";
  const words = [];
  if (sky[5] > 0.05) words.push(`rain ${sky[5].toFixed(1)} mm/h`);
  if (sky[6] > 0.05) words.push(`snow ${sky[6].toFixed(1)} mm/h`);
  if (sky[7] < 1500) words.push(`fog, ${Math.round(sky[7])} m to see`);
  if (!words.length) words.push(sky[4] > 0.7 ? "overcast" : sky[4] > 0.35 ? "cloudy" : "fair");
  if (Number.isFinite(sky[10])) words.push(`${Math.round(sky[10])} °C`);
  return words.join(", ");
}
