// Robots: every link where base pose and joint angles put it.

import { THREE } from "./three.js";
import { materialOf } from "./city.js";
import { meshGeometry } from "./materials.js";

const FARTHEST = 300;
const NEAR = 40;

export class Robots {
  /** @param {any} scene @param {import("./city.js").City} city @param {import("./source.js").Source} source */
  constructor(scene, city, source) {
    this.scene = scene;
    this.city = city;
    this.source = source;
    /** @type {Map<number, any>} */
    this.known = new Map();
    this._a = new THREE.Quaternion();
    this._b = new THREE.Quaternion();
    /** Metres from the underside of a body to where its base is drawn, by entity: labels stand above. */
    this._link = new THREE.Matrix4();
    this._turn = new THREE.Matrix4();
  }

  /** @param {number} entity @returns {string | null} */
  modelOf(entity) {
    const agent = this.source.run.agents.find((/** @type {any} */ a) => a.entity === entity);
    const name = agent?.model ?? this.source.cast.get(entity)?.model ?? this.source.cast.get(entity)?.name.split(" ")[0];
    return name && this.city.manifest?.robots[name] ? name : null;
  }

  /** @param {number} entity @returns {any} */
  _make(entity) {
    const name = this.modelOf(entity);
    const shapes = this.city.robotShapes;
    if (!name || !shapes) return null;
    const model = this.city.manifest.robots[name];
    const group = new THREE.Group();
    const links = model.links.map((/** @type {any} */ link) => {
      const node = new THREE.Group();
      node.matrixAutoUpdate = false;
      const near = new THREE.Group();
      const far = new THREE.Group();
      for (const [into, meshes] of [[near, link.near], [far, link.far]]) {
        for (const mesh of meshes) {
          const part = new THREE.Mesh(meshGeometry(shapes, mesh), this.city.materials[materialOf(mesh, this.city.pictures.length)]);
          part.frustumCulled = false;
          into.add(part);
        }
      }
      node.add(near, far);
      group.add(node);
      return { node, near, far, world: new THREE.Matrix4(), entry: link };
    });
    this.scene.add(group);
    return { model, group, links, angles: new Float32Array(model.joints.length) };
  }

  /** @param {import("./between.js").Between} between @param {any} camera @param {number} now */
  update(between, camera, now) {
    const { before, after, share } = /** @type {any} */ (between);
    for (const robot of this.known.values()) if (robot) robot.group.visible = false;
    if (!before || !this.city.robotShapes) return;
    const { robots } = before;
    for (let row = 0; row < robots.entity.length; row++) {
      const entity = robots.entity[row];
      if (!this.known.has(entity)) this.known.set(entity, this._make(entity));
      const robot = this.known.get(entity);
      if (!robot) continue;
      const other = after.rows.robots.get(entity);
      const pose = baseBetween(robots, row, after.robots, other, share, this._a, this._b);
      const away = Math.hypot(pose.x - camera.position.x, pose.y - camera.position.y, pose.z - camera.position.z);
      if (away > FARTHEST) continue;
      robot.group.visible = true;
      anglesBetween(robot, before.joints, after.joints, entity, share);
      this._links(robot, pose, away < NEAR, now);
    }
  }

  /** @param {any} robot @param {any} pose @param {boolean} isNear @param {number} now */
  _links(robot, pose, isNear, now) {
    const one = new THREE.Vector3(1, 1, 1);
    for (const link of robot.links) {
      const { entry } = link;
      if (entry.parent < 0) link.world.compose(new THREE.Vector3(pose.x, pose.y, pose.z), pose.quaternion, one);
      else {
        const [w, x, y, z] = entry.quaternion;
        this._link.compose(new THREE.Vector3(...entry.position), new THREE.Quaternion(x, y, z, w), one);
        for (const joint of entry.joints) this._apply(joint, joint.index === null ? 0 : robot.angles[joint.index] - joint.zero);
        if (entry.rotor) this._link.multiply(this._turn.makeRotationZ(entry.rotor * now * 0.06));
        link.world.multiplyMatrices(robot.links[entry.parent].world, this._link);
      }
      link.node.matrix.copy(link.world);
      link.near.visible = isNear;
      link.far.visible = !isNear;
    }
  }

  /** @param {any} joint @param {number} value */
  _apply(joint, value) {
    const [ax, ay, az] = joint.axis;
    if (joint.slides) {
      this._link.multiply(this._turn.makeTranslation(ax * value, ay * value, az * value));
      return;
    }
    const [x, y, z] = joint.at;
    this._link.multiply(this._turn.makeTranslation(x, y, z));
    this._link.multiply(this._turn.makeRotationAxis(new THREE.Vector3(ax, ay, az).normalize(), value));
    this._link.multiply(this._turn.makeTranslation(-x, -y, -z));
  }
}

/** @param {any} a @param {number} row @param {any} b @param {number | undefined} other @param {number} share @param {any} q @param {any} r */
function baseBetween(a, row, b, other, share, q, r) {
  q.set(a.qx[row], a.qy[row], a.qz[row], a.qw[row]).normalize();
  const at = { x: a.x[row] / 1000, y: a.y[row] / 1000, z: a.z[row] / 1000, quaternion: q };
  if (other === undefined) return at;
  const to = [b.x[other] / 1000, b.y[other] / 1000, b.z[other] / 1000];
  if (Math.hypot(to[0] - at.x, to[1] - at.y) > 20) return at;
  q.slerp(r.set(b.qx[other], b.qy[other], b.qz[other], b.qw[other]).normalize(), share);
  at.x += (to[0] - at.x) * share;
  at.y += (to[1] - at.y) * share;
  at.z += (to[2] - at.z) * share;
  return at;
}

/** @param {any} robot @param {any} a @param {any} b @param {number} entity @param {number} share */
function anglesBetween(robot, a, b, entity, share) {
  for (let k = 0; k < a.entity.length; k++) if (a.entity[k] === entity) robot.angles[a.joint[k]] = a.angle[k] / 10000;
  for (let k = 0; k < b.entity.length; k++) {
    if (b.entity[k] !== entity) continue;
    const from = robot.angles[b.joint[k]];
    let turn = b.angle[k] / 10000 - from;
    // Wheels turn more than once round between two steps: then they are where they were before or after.
    if (Math.abs(turn) > 2 * Math.PI) turn %= 2 * Math.PI;
    robot.angles[b.joint[k]] = from + turn * share;
  }
}
