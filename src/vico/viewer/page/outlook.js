// The city from afar: walls, roofs and ground of all tiles in two meshes, of which the tiles in view are drawn.

import { THREE } from "./three.js";
import { groundGeometry } from "./ground_meshes.js";
import { meshGeometry, plainMaterial } from "./materials.js";

/** Ground from afar lies so far below what is near, metres, where tiles do not quite meet. */
const LOWERED = 0.6;

/** Parts of tiles joined into one mesh: its triangles are those of the tiles in view, the nearest first. */
class Joined {
  /** @param {any[]} parts geometries, null where a tile has none @param {any} material */
  constructor(parts, material) {
    /** @type {{first: number, vertices: number, index: any}[]} */
    this.parts = [];
    let first = 0;
    let indices = 0;
    for (const part of parts) {
      const vertices = part ? part.attributes.position.count : 0;
      this.parts.push({ first, vertices, index: part?.index.array ?? [] });
      first += vertices;
      indices += part?.index.count ?? 0;
    }
    const geometry = new THREE.BufferGeometry();
    for (const [name, size, Type] of /** @type {[string, number, any][]} */ ([["position", 3, Float32Array], ["facing", 4, Int8Array], ["uv", 2, Float32Array], ["tint", 4, Uint8Array]])) {
      const array = new Type(size * first);
      parts.forEach((part, k) => part && array.set(part.attributes[name].array, size * this.parts[k].first));
      geometry.setAttribute(name, new THREE.BufferAttribute(array, size, Type !== Float32Array));
    }
    geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(indices), 1));
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.frustumCulled = false;
    this._key = "";
  }

  /** @param {number[]} tiles which are drawn, the nearest first */
  show(tiles) {
    const key = tiles.join(" ");
    if (key === this._key) return;
    this._key = key;
    const { geometry } = this.mesh;
    const index = geometry.index;
    let at = 0;
    for (const tile of tiles) {
      const { first, index: own } = this.parts[tile];
      for (let k = 0; k < own.length; k++) index.array[at + k] = own[k] + first;
      at += own.length;
    }
    index.clearUpdateRanges();
    if (at) {
      index.addUpdateRange(0, at);
      index.needsUpdate = true;
    }
    geometry.setDrawRange(0, at);
  }

  /** @param {number} tile @param {number} by metres */
  lift(tile, by) {
    const { position } = this.mesh.geometry.attributes;
    const { first, vertices } = this.parts[tile];
    for (let k = first; k < first + vertices; k++) position.array[3 * k + 2] += by;
    position.addUpdateRange(3 * first, 3 * vertices);
    position.needsUpdate = true;
  }
}

export class Outlook {
  /**
   * @param {any} scene
   * @param {import("./light.js").Light} light
   * @param {any} manifest
   * @param {ArrayBuffer} buffer
   * @param {{picture: any, fine: boolean}} looks the ground from above, and whether a graphics card paints
   */
  constructor(scene, light, manifest, buffer, { picture, fine }) {
    const { tiles, ground, half } = manifest;
    const walls = tiles.map((/** @type {any} */ tile) => (tile.far ? meshGeometry(buffer, tile.far) : null));
    const floors = tiles.map((/** @type {any} */ tile) => groundGeometry(buffer, ground, tile, half));
    this.bounds = tiles.map((/** @type {any} */ _, /** @type {number} */ k) => {
      floors[k].computeBoundingBox();
      const box = floors[k].boundingBox;
      return walls[k] ? box.union(walls[k].boundingBox) : box;
    });
    this.floors = new Joined(floors, plainMaterial(light, fine, picture));
    this.walls = new Joined(walls, plainMaterial(light, fine));
    // After what is near and hides them, the walls before the ground.
    this.walls.mesh.renderOrder = -9;
    this.floors.mesh.renderOrder = -8;
    scene.add(this.walls.mesh, this.floors.mesh);
    /** Meshes to aim at, never drawn: walls with the building of each vertex. */
    this.aims = walls.filter(Boolean).map((/** @type {any} */ geometry) => new THREE.Mesh(geometry));
    this.whole = tiles.map(() => false);
    this._frustum = new THREE.Frustum();
    this._matrix = new THREE.Matrix4();
  }

  /**
   * @param {any} camera
   * @param {boolean[]} whole which tiles are drawn whole instead
   * @param {number[]} away metres to each tile
   * @param {boolean} hidden whether nothing is to be seen
   */
  update(camera, whole, away, hidden) {
    this.walls.mesh.visible = this.floors.mesh.visible = !hidden;
    if (hidden) return;
    whole.forEach((is, tile) => {
      if (is !== this.whole[tile]) this.floors.lift(tile, is ? -LOWERED : LOWERED);
      this.whole[tile] = is;
    });
    this._frustum.setFromProjectionMatrix(this._matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse));
    const seen = away.map((_, tile) => tile).filter((tile) => this._frustum.intersectsBox(this.bounds[tile]));
    seen.sort((a, b) => away[a] - away[b]);
    this.floors.show(seen);
    this.walls.show(seen.filter((tile) => !whole[tile]));
  }
}
