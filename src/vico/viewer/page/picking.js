// What a click in the picture means: a body, a building, or a spot on the ground.

import { THREE } from "./three.js";

/** Kinds that a click chooses, and how far beside them it may be, metres. */
const RADII = /** @type {Record<string, number>} */ ({ resident: 0.5, assistant: 0.5, pedestrian: 0.5, robot: 0.6, cyclist: 0.8, bicycle: 0.8, object: 0.35 });

/**
 * @param {import("./view.js").View} view
 * @param {import("./between.js").Between} between
 * @param {number} x in the canvas, pixels
 * @param {number} y
 * @returns {{entity?: number, building?: any, spot?: {x: number, y: number, z: number}}}
 */
export function pick(view, between, x, y) {
  const { clientWidth, clientHeight } = view.canvas;
  const ray = new THREE.Raycaster();
  ray.setFromCamera(new THREE.Vector2((x / clientWidth) * 2 - 1, 1 - (y / clientHeight) * 2), view.camera);
  const hits = ray.intersectObjects(view.city.walls, false);
  const wall = hits[0];
  const ground = groundHit(view, ray.ray);
  const reach = Math.min(wall?.distance ?? Infinity, (ground?.distance ?? Infinity) + 2);
  const entity = bodyHit(view, between, ray.ray, reach);
  if (entity) return { entity };
  if (wall && wall.distance < (ground?.distance ?? Infinity)) {
    const number = wall.object.geometry.userData.entity[wall.face.a];
    const building = view.city.manifest.buildings.find((/** @type {any} */ b) => b.entity === number);
    if (building) return { building };
  }
  return ground ? { spot: ground.at } : {};
}

/** @param {any} view @param {any} between @param {any} ray @param {number} reach */
function bodyHit(view, between, ray, reach) {
  let best = 0;
  let least = Infinity;
  const a = new THREE.Vector3();
  const b = new THREE.Vector3();
  const at = new THREE.Vector3();
  const on = new THREE.Vector3();
  for (const [entity, body] of between.bodies) {
    const member = view.source.cast.get(entity);
    if (!member) continue;
    const [length, width, height] = member.size;
    a.set(body.x, body.y, body.z);
    b.set(body.x, body.y, body.z + Math.max(height, 0.3));
    const vehicle = RADII[member.kind] === undefined;
    if (vehicle) {
      a.set(body.x - (Math.cos(body.yaw) * length) / 2.4, body.y - (Math.sin(body.yaw) * length) / 2.4, body.z + height / 2);
      b.set(body.x + (Math.cos(body.yaw) * length) / 2.4, body.y + (Math.sin(body.yaw) * length) / 2.4, body.z + height / 2);
    }
    // Rounding may leave a little less than nothing.
    const away = Math.sqrt(Math.max(ray.distanceSqToSegment(a, b, at, on), 0));
    const distance = at.distanceTo(ray.origin);
    // Far away a few pixels beside somebody still mean them.
    const allowed = (vehicle ? Math.max(width, height) / 2 : RADII[member.kind]) + distance * 0.006;
    if (away > allowed || distance > reach + 1.5) continue;
    const score = distance + away * 4;
    if (score < least) [best, least] = [entity, score];
  }
  return best;
}

/** @param {any} view @param {any} ray */
function groundHit(view, ray) {
  if (ray.direction.z > -0.01) return null;
  let distance = (view.groundAt(view.cameras.target) - ray.origin.z) / ray.direction.z;
  // The ground is all but level: a few steps find where it is met.
  for (let k = 0; k < 4; k++) {
    const x = ray.origin.x + ray.direction.x * distance;
    const y = ray.origin.y + ray.direction.y * distance;
    distance = (view.groundAt({ x, y }) - ray.origin.z) / ray.direction.z;
  }
  if (!(distance > 0 && distance < 3000)) return null;
  const at = ray.at(distance, new THREE.Vector3());
  return { distance, at: { x: at.x, y: at.y, z: at.z } };
}
