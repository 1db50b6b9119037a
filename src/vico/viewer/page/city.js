// The city that stands: tiles near and far, the ground, what stands in the street, and rooms one goes into.

import { THREE } from "./three.js";
import { getJson } from "./source.js";
import { cityMaterial, meshGeometry } from "./materials.js";
import { lampPlaces, lampPools } from "./ground_meshes.js";
import { Instances } from "./instances.js";
import { Outlook } from "./outlook.js";
import { pictureArray } from "./pictures.js";

/** Tiles of which the whole geometry is kept in memory. */
const KEPT = 40;

export class City {
  /**
   * @param {any} scene
   * @param {import("./light.js").Light} light
   */
  constructor(scene, light) {
    this.scene = scene;
    this.light = light;
    /** @type {any} */
    this.manifest = null;
    /** @type {any[]} */
    this.tiles = [];
    /** @type {any[]} */
    this.materials = [];
    /** @type {any[]} of what stands in numbers: a graphics library makes them anew where both kinds share one */
    this.instancedMaterials = [];
    /** @type {any[]} */
    this.insideMaterials = [];
    /** @type {{value: any}[]} */
    this.pictures = [];
    /** @type {ArrayBuffer | undefined} */
    this.robotShapes = undefined;
    /** Which file of rooms is shown, -1 for none: then one is inside. */
    this.inside = -1;
    /** @type {Map<string, any>} */
    this.models = new Map();
    this.textured = false;
    /** Whether the processor draws, not a graphics card. */
    this.software = false;
    /** Metres within which tiles are drawn whole. */
    this.nearReach = 130;
    /** How many parts have come so far. */
    this.arrived = 0;
    /** @type {Instances | null} */
    this.instances = null;
    /** @type {Outlook | null} the city from afar */
    this.outlook = null;
    /** Height of the lowest ground, metres. */
    this.lowest = 0;
    /** @type {{at: Float32Array, middle: number, radius: number}[]} trees, as `BuildingShade.addTrees` has them */
    this.trees = [];
    this.reach = { near: 45, far: 420 };
    /** @type {number[][]} spots that lamps light: x, y, z and radius */
    this.lamps = [];
    this._round = 0;
    this._ready = new Promise((resolve) => (this._resolveReady = resolve));
    /** @type {any} */
    this.rooms = null;
    /** @type {Map<number, any>} */
    this._roomFiles = new Map();
  }

  /**
   * Fetch what the first picture needs: the outlook over the whole city.
   * @param {import("./ground.js").CityBase} base
   * @returns {Promise<ArrayBuffer>}
   */
  async open({ manifest, picture }) {
    this.manifest = manifest;
    const outlook = await bytes("city/outlook.bin");
    const pictures = this.manifest.arrays.map(() => ({ value: pictureArray({ width: 1, height: 1 }, 1) }));
    this.pictures = pictures;
    const all = () => [false, true].flatMap((both) => pictures.map((/** @type {any} */ array) => cityMaterial(this.light, array, false, both)));
    this.materials = all();
    this.instancedMaterials = all();
    this.insideMaterials = [false, true].flatMap((both) => pictures.map((/** @type {any} */ array, k) => cityMaterial(this.light, array, true, both, k === 0)));
    this._outlook(outlook, new THREE.CanvasTexture(picture));
    this._shapes(outlook);
    this._textures();
    return outlook;
  }

  /** @param {ArrayBuffer} buffer @param {any} picture */
  _outlook(buffer, picture) {
    picture.anisotropy = 4;
    this.outlook = new Outlook(this.scene, this.light, this.manifest, buffer, { picture, fine: !this.software });
    this.tiles = this.manifest.tiles.map((/** @type {any} */ entry) => ({ entry, near: null, wanted: 0, loading: false }));
    this._surroundings(buffer, this.manifest.ground);
  }

  /** @param {ArrayBuffer} outlook @param {any} ground */
  _surroundings(outlook, ground) {
    const heights = new Float32Array(outlook, ground.offset, ground.points * ground.points * this.manifest.count ** 2);
    const low = heights.reduce((a, b) => Math.min(a, b), Infinity);
    this.lowest = low;
    const material = new THREE.ShaderMaterial({
      uniforms: { colour: this.light.ground, fog: this.light.fog, reach: this.light.reach },
      vertexShader: `uniform float reach; varying float f; void main() { vec4 v = modelViewMatrix * vec4(position, 1.0);
        float d = length(v.xyz) / min(reach, 420.0); f = 1.0 - exp(-d * d * 0.6); gl_Position = projectionMatrix * v; }`,
      fragmentShader: `uniform vec3 colour, fog; varying float f;
        void main() { gl_FragColor = vec4(mix(colour * 1.25, fog, f), 1.0); }`,
    });
    const { half } = this.manifest;
    const ring = new THREE.RingGeometry(half * 0.9, half + 2500, 48, 8);
    const plane = new THREE.Mesh(ring, material);
    plane.position.z = low - 1.5;
    this._plane = plane;
    this.scene.add(plane);
  }

  /** @param {{near: number, far: number}} reach metres to which things are drawn whole, and at all */
  setReach(reach) {
    this.reach = reach;
    this.instances?.setReach(reach);
  }

  /** @param {ArrayBuffer} outlook */
  async _shapes(outlook) {
    const shapes = await bytes("city/models.bin");
    for (const [name, entry] of Object.entries(this.manifest.models)) this._addModel(name, entry, shapes);
    this.robotShapes = shapes;
    this.instances = new Instances(this.scene, this, this.reach);
    for (const entry of this.manifest.instances) this.instances.add(entry, outlook);
    this.trees = treesOf(this.manifest.instances, this.models, outlook);
    this.lamps = lampPlaces(this, outlook);
    this.pools = lampPools(this.lamps, this.light);
    if (this.pools) this.scene.add(this.pools);
    this._resolveReady?.(null);
  }

  /** Whether textures, models, tiles or rooms are still on their way. */
  get pending() {
    if (!this.textured || !this.instances) return true;
    for (const group of this._roomFiles.values()) if (!group) return true;
    return this.tiles.some((tile) => tile.loading);
  }

  /** Resolves when the shapes of vehicles and the like are there. */
  get ready() {
    return this._ready;
  }

  /** @param {string} name @param {any} entry @param {ArrayBuffer} shapes */
  _addModel(name, entry, shapes) {
    this.models.set(name, {
      near: entry.near.map((/** @type {any} */ mesh) => ({ geometry: meshGeometry(shapes, mesh), array: materialOf(mesh, this.pictures.length) })),
      far: entry.far.map((/** @type {any} */ mesh) => ({ geometry: meshGeometry(shapes, mesh), array: materialOf(mesh, this.pictures.length) })),
      low: entry.low,
      high: entry.high,
    });
  }

  async _textures() {
    const buffer = await bytes("city/textures.bin");
    const worker = new Worker(new URL("./textures_worker.js", import.meta.url), { type: "module" });
    let left = this.manifest.arrays.length;
    worker.onmessage = ({ data }) => {
      if (data.layers) {
        this.pictures[data.number].value = pictureArray(data, data.layers, data.data, !this.software);
      }
      if (--left === 0) {
        worker.terminate();
        this.textured = true;
        this.arrived++;
      }
    };
    const { textures, arrays } = this.manifest;
    worker.postMessage({ buffer, textures, arrays }, [buffer]);
  }

  /**
   * Draw tiles near the camera whole, and the others from afar.
   * @param {any} camera
   */
  update(camera) {
    const { tile: side } = this.manifest;
    const { x, y, z } = camera.position;
    const hidden = this.inside >= 0;
    this._round++;
    const away = this.tiles.map(({ entry }) => {
      const dx = Math.max(entry.x - x, 0, x - entry.x - side);
      const dy = Math.max(entry.y - y, 0, y - entry.y - side);
      return Math.hypot(dx, dy, Math.max(0, z - 40));
    });
    const whole = this.tiles.map((tile, k) => {
      const isNear = !hidden && this.textured && away[k] < this.nearReach * (tile.near?.visible ? 1.1 : 1);
      if (isNear && !tile.near && !tile.loading) this._load(tile);
      if (isNear) tile.wanted = this._round;
      if (!tile.near) return false;
      tile.near.visible = isNear;
      // What is near is drawn first: what it hides costs nothing then.
      for (const mesh of tile.near.children) mesh.renderOrder = -100 + Math.min(away[k], 900) / 10;
      return isNear;
    });
    this.outlook?.update(camera, whole, away, hidden);
    if (this.instances) this.instances.update(camera, this.inside >= 0);
    if (this.pools) this.pools.visible = this.light.night.value > 0.2 && this.inside < 0;
    if (this._plane) this._plane.visible = this.inside < 0;
  }

  /** @param {any} tile */
  async _load(tile) {
    tile.loading = true;
    try {
      const buffer = await bytes(`city/${tile.entry.file}`);
      const group = new THREE.Group();
      for (const entry of tile.entry.near) {
        group.add(new THREE.Mesh(meshGeometry(buffer, entry), this.materials[materialOf(entry, this.pictures.length)]));
      }
      tile.near = group;
      this.arrived++;
      this.scene.add(group);
      this._forget();
    } finally {
      tile.loading = false;
    }
  }

  /** Let go of the tiles that were not wanted for longest. */
  _forget() {
    const held = this.tiles.filter((tile) => tile.near);
    if (held.length <= KEPT) return;
    held.sort((a, b) => a.wanted - b.wanted);
    for (const tile of held.slice(0, held.length - KEPT)) {
      this.scene.remove(tile.near);
      for (const mesh of tile.near.children) mesh.geometry.dispose();
      tile.near = null;
    }
  }

  /**
   * Show the rooms of the building that a room is in; none for -1.
   * @param {number} room index in the world
   */
  async showRoom(room) {
    if (!this.rooms && room >= 0 && this.textured) {
      this.rooms = {};
      const [index, shapes] = await Promise.all([getJson("city/rooms.json"), bytes("city/furniture.bin")]);
      this.rooms = index;
      for (const [name, entry] of Object.entries(index.furniture)) {
        if (!this.models.has(name)) this._addModel(name, { low: [0, 0, 0], high: [1, 1, 1], .../** @type {any} */ (entry) }, shapes);
      }
    }
    const wanted = room >= 0 && this.rooms?.rooms ? this.rooms.rooms[room] : -1;
    for (const [number, group] of this._roomFiles) if (group) group.visible = number === wanted;
    this.inside = wanted;
    if (wanted < 0 || this._roomFiles.has(wanted)) return;
    this._roomFiles.set(wanted, null);
    const entry = this.rooms.files[wanted];
    const buffer = await bytes(`city/${entry.file}`);
    const group = new THREE.Group();
    for (const mesh of entry.near) group.add(new THREE.Mesh(meshGeometry(buffer, mesh), this.insideMaterials[materialOf(mesh, this.pictures.length)]));
    const furniture = new Instances(group, this, { near: 45, far: 0 }, this.insideMaterials);
    for (const instance of entry.instances) furniture.add(instance, buffer);
    furniture.fillAll();
    this.scene.add(group);
    this._roomFiles.set(wanted, group);
    this.arrived++;
  }

  /** Walls, floors and ceilings round the camera's target: those of the rooms one is in, or the far walls. */
  get obstacles() {
    if (this.inside < 0) return this.walls;
    return (this._roomFiles.get(this.inside)?.children ?? []).filter((/** @type {any} */ mesh) => !mesh.isInstancedMesh);
  }

  /** Meshes to aim at: far walls, with the building of each vertex. */
  get walls() {
    return this.outlook?.aims ?? [];
  }
}

/** @param {any} mesh @param {number} arrays @returns {number} which material draws it: those seen from both sides come last */
export function materialOf(mesh, arrays) {
  return mesh.array + (mesh.both ? arrays : 0);
}

/**
 * Where trees stand, and how large their crowns are: the upper two thirds of them.
 * @param {any[]} instances @param {Map<string, any>} models @param {ArrayBuffer} outlook
 */
function treesOf(instances, models, outlook) {
  return instances
    .filter(({ prototype }) => prototype.startsWith("tree") && models.has(prototype))
    .map(({ prototype, offset, count }) => {
      const { low, high } = models.get(prototype);
      return { at: new Float32Array(outlook, offset, 5 * count), middle: low[2] + 0.62 * (high[2] - low[2]), radius: (high[0] - low[0] + high[1] - low[1]) / 4 };
    });
}

/** @param {string} path @returns {Promise<ArrayBuffer>} */
export async function bytes(path) {
  const answer = await fetch(path);
  if (!answer.ok) throw new Error(`${path}: ${answer.status}`);
  return answer.arrayBuffer();
}
