// Doors of houses that are open: the wall is opened where the door is, and its leaves and the hall behind it are drawn.

import { THREE } from "./three.js";

/** Open doors turn so far, radians; gates go back behind the wall before they go up, metres. */
const [AJAR, BEHIND] = [(84 * Math.PI) / 180, 0.25];
/** The opening is cut so far before the closed leaf, metres. */
const BEFORE = 0.031;
const MARK = 1;
/** After what is near, before what is far: the wall is there already, and what is behind it is not. */
const ORDER = -10;

const PORTAL = new THREE.PlaneGeometry(1, 1).rotateX(Math.PI / 2);
const mark = new THREE.ShaderMaterial({
  vertexShader: "void main() { gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }",
  fragmentShader: "void main() { gl_FragColor = vec4(0.0); }",
  colorWrite: false,
  depthWrite: false,
  side: THREE.DoubleSide,
  stencilWrite: true,
  stencilRef: MARK,
  stencilZPass: THREE.ReplaceStencilOp,
});
const clear = new THREE.ShaderMaterial({
  // As far away as anything can be: what is behind the door is drawn over it.
  vertexShader: "void main() { gl_Position = (projectionMatrix * modelViewMatrix * vec4(position, 1.0)).xyww; }",
  fragmentShader: "void main() { gl_FragColor = vec4(0.2, 0.18, 0.16, 1.0); }",
  depthFunc: THREE.AlwaysDepth,
  side: THREE.DoubleSide,
  stencilWrite: true,
  stencilRef: MARK,
  stencilFunc: THREE.EqualStencilFunc,
});

export class Doors {
  /** @param {any} scene @param {import("./city.js").City} city */
  constructor(scene, city) {
    this.scene = scene;
    this.city = city;
    /** @type {Map<number, any> | null} doors that can be drawn open, by entrance */
    this.entries = null;
    /** @type {Map<number, any>} those that are drawn, by entrance */
    this.open = new Map();
    /** @type {any[]} */
    this.materials = [];
  }

  /** @param {import("./between.js").Between} between @param {any} camera */
  update(between, camera) {
    if (!this.city.instances || !between.before) return;
    this.entries ??= new Map((this.city.manifest.doors ?? []).map((/** @type {any} */ door) => [door.entrance, door]));
    const shares = sharesAt(between);
    for (const [entrance, drawn] of this.open) {
      if (!shares.has(entrance)) this._remove(entrance, drawn);
    }
    for (const [entrance, share] of shares) {
      const door = this.entries.get(entrance);
      if (!door) continue;
      if (!this.open.has(entrance)) this.open.set(entrance, this._make(door));
      const { group, leaves } = this.open.get(entrance);
      const [x, y] = door.at;
      // From afar walls are plain: there are no doors to open.
      group.visible = this.city.inside < 0 && Math.hypot(x - camera.position.x, y - camera.position.y) < this.city.nearReach;
      leaves.forEach((/** @type {any} */ leaf, /** @type {number} */ k) => place(leaf, door, k, share));
    }
  }

  /** @param {any} door @returns {{group: any, leaves: any[]}} */
  _make(door) {
    if (!this.materials.length) this.materials = this.city.materials.map(behindDoors);
    const group = new THREE.Group();
    const [ix, iy] = door.inward;
    const right = new THREE.Vector3(iy, -ix, 0);
    group.applyMatrix4(new THREE.Matrix4().makeBasis(right, new THREE.Vector3(ix, iy, 0), new THREE.Vector3(0, 0, 1)).setPosition(...door.at));
    for (const [k, material] of [mark, clear].entries()) {
      const portal = new THREE.Mesh(PORTAL, material);
      portal.scale.set(2 * door.half_width, 1, door.height);
      portal.position.set(0, -BEFORE, door.height / 2);
      portal.renderOrder = ORDER + 0.1 * k;
      group.add(portal);
    }
    group.add(this._model(door.hall, ORDER + 0.2));
    const leaves = door.leaves.map((/** @type {string} */ name) => this._model(name, ORDER + 0.3));
    group.add(...leaves);
    this.scene.add(group);
    return { group, leaves };
  }

  /** @param {string} name @param {number} order @returns {any} */
  _model(name, order) {
    const group = new THREE.Group();
    for (const { geometry, array } of this.city.models.get(name)?.near ?? []) {
      const mesh = new THREE.Mesh(geometry, this.materials[array]);
      mesh.renderOrder = order;
      group.add(mesh);
    }
    return group;
  }

  /** @param {number} entrance @param {any} drawn */
  _remove(entrance, { group }) {
    this.scene.remove(group);
    this.open.delete(entrance);
  }
}

/** A material that paints nothing but what is seen through open doors. @param {any} material */
function behindDoors(material) {
  const through = material.clone();
  // Clones have uniforms of their own: these are the city's.
  through.uniforms = material.uniforms;
  through.side = THREE.DoubleSide;
  through.stencilWrite = true;
  through.stencilRef = MARK;
  through.stencilFunc = THREE.EqualStencilFunc;
  return through;
}

/** @param {any} leaf @param {any} door @param {number} number @param {number} share how far it is open, 0..1 */
function place(leaf, door, number, share) {
  const side = number ? 1 : -1;
  leaf.position.set(side * door.half_width, 0, 0);
  if (door.gate) leaf.position.set(side * door.half_width, BEHIND * Math.min(8 * share, 1), share * door.height);
  else leaf.rotation.z = -side * AJAR * share * share * (3 - 2 * share);
}

/**
 * How far doors are open between two steps, 0..1, by entrance.
 * @param {import("./between.js").Between} between
 * @returns {Map<number, number>}
 */
export function sharesAt({ before, after, share }) {
  const found = new Map();
  const add = (/** @type {any} */ frame, /** @type {number} */ part) => {
    if (!frame?.doors) return;
    frame.doors.entrance.forEach((/** @type {number} */ entrance, /** @type {number} */ k) => found.set(entrance, (found.get(entrance) ?? 0) + (part * frame.doors.share[k]) / 100));
  };
  add(before, after ? 1 - share : 1);
  add(after, share);
  return found;
}
