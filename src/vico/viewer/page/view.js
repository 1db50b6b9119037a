// The 3D picture: scene, camera, renderer, and how much of it is drawn so that it stays fluent.

import { THREE } from "./three.js";
import { BuildingShade } from "./building_shade.js";
import { makeLight, setLight } from "./light.js";
import { setShaded } from "./materials.js";
import { City } from "./city.js";
import { Cameras } from "./cameras.js";
import { Doors } from "./doors.js";
import { Sky } from "./sky.js";
import { People } from "./people.js";
import { Vehicles } from "./vehicles.js";
import { Robots } from "./robots.js";
import { Overlay } from "./overlay.js";
import { Happenings } from "./happenings.js";

/** Levels of care, the plainest first: pixels' share, reach of whole tiles, of full bodies, of things (metres). */
const CARE = [
  { pixels: 0.36, tiles: 12, bodies: 8, things: 14, far: 70 },
  { pixels: 0.5, tiles: 25, bodies: 12, things: 20, far: 110 },
  { pixels: 0.65, tiles: 50, bodies: 18, things: 28, far: 200 },
  { pixels: 0.8, tiles: 100, bodies: 28, things: 40, far: 380 },
  { pixels: 1, tiles: 140, bodies: 40, things: 50, far: 480 },
  { pixels: 1.5, tiles: 220, bodies: 70, things: 80, far: 800 },
];
const GOAL = 30;
/** The level of a picture that rests. */
const FINE = 4;

/** @param {any} gl @returns {string} what draws */
function nameOf(gl) {
  const told = gl.getExtension("WEBGL_debug_renderer_info");
  return String(gl.getParameter(told ? told.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
}

export class View {
  /** @param {HTMLCanvasElement} canvas @param {import("./source.js").Source} source */
  constructor(canvas, source) {
    this.canvas = canvas;
    this.source = source;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: false, stencil: true, powerPreference: "high-performance", preserveDrawingBuffer: true });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.renderer.setClearColor(0x9fb4c6);
    const software = /swiftshader|llvmpipe|software|basic render/i.test(nameOf(this.renderer.getContext()));
    this.scene = new THREE.Scene();
    this.scene.matrixWorldAutoUpdate = true;
    this.camera = new THREE.PerspectiveCamera(55, 1, 0.25, 6000);
    this.light = makeLight();
    this.city = new City(this.scene, this.light);
    this.city.software = software;
    this.cameras = new Cameras(this.camera, canvas, (p) => this.groundAt(p), (from, way, reach) => this.sight(from, way, reach));
    this._ray = new THREE.Raycaster();
    this.sky = new Sky(this.scene, this.light);
    this.people = new People(this.scene, this.light, source, this.city);
    this.vehicles = new Vehicles(this.scene, this.city, this.light, source);
    this.robots = new Robots(this.scene, this.city, source);
    this.vehicles.people = this.people;
    this.doors = new Doors(this.scene, this.city);
    this.overlay = new Overlay(this.scene, this);
    this.happenings = new Happenings(this.scene, this);
    /** @type {BuildingShade | null} */
    this.shade = null;
    this._trees = false;
    this.care = 3;
    /** Whether the level of care follows the frames a second. */
    this.adapts = true;
    this.stats = { fps: 0, triangles: 0, calls: 0, care: 3, first: 0 };
    this._since = 0;
    this._size = "";
    this._key = "";
    this._moved = 0;
    this._fine = false;
    this._fineSince = 0;
    this._careBefore = 3;
    this._resize = true;
    this._frames = 0;
    this._heights = null;
    this.setCare(software ? 1 : 4);
  }

  /** @param {import("./ground.js").CityBase} base */
  async open(base) {
    const outlook = await this.city.open(base);
    const { count, ground, tile, half } = base.manifest;
    this._heights = { data: new Float32Array(outlook, ground.offset, ground.points ** 2 * count ** 2), count, ground, tile, half };
    this.shade = new BuildingShade(this.renderer, this.light, { half, low: this.city.lowest, side: this.city.software ? 1024 : 2048 });
    this.shade.addBuildings(this.city.walls.map((/** @type {any} */ mesh) => mesh.geometry));
    this.setCare(this.care);
    this.cameras.target.set(0, 0, this.groundAt({ x: 0, y: 0 }) + 1.4);
  }

  /** @param {{x: number, y: number}} at @returns {number} height of the ground, roughly */
  groundAt({ x, y }) {
    if (!this._heights) return 0;
    const { data, count, ground, tile, half } = this._heights;
    const clamp = (/** @type {number} */ v) => Math.min(Math.max(v + half, 0), 2 * half - 1e-3);
    const u = clamp(x);
    const v = clamp(y);
    const ix = Math.min(Math.floor(u / tile), count - 1);
    const iy = Math.min(Math.floor(v / tile), count - 1);
    const n = ground.points;
    const jx = Math.min(Math.round((u - ix * tile) / ground.step), n - 1);
    const jy = Math.min(Math.round((v - iy * tile) / ground.step), n - 1);
    return data[(iy * count + ix) * n * n + jy * n + jx];
  }

  /** @param {any} from @param {any} way @param {number} reach @returns {number} metres to the first wall, at most `reach` */
  sight(from, way, reach) {
    this._ray.set(from, way);
    this._ray.far = reach;
    return this._ray.intersectObjects(this.city.obstacles, false)[0]?.distance ?? reach;
  }

  /** @param {number} level */
  setCare(level) {
    this.care = Math.min(Math.max(level, 0), CARE.length - 1);
    const care = CARE[this.care];
    this.stats.care = this.care;
    const spares = this.city.software && this.care < FINE;
    this.sky.setPlain(spares);
    setShaded(this.light, !spares && (this.shade?.can ?? true));
    this.city.nearReach = care.tiles;
    this.people.nearReach = care.bodies;
    this.city.setReach({ near: care.things, far: care.far });
    this._resize = true;
  }

  resize() {
    const { clientWidth, clientHeight } = this.canvas;
    const ratio = Math.min(devicePixelRatio, 2) * Math.min(CARE[this.care].pixels, 1);
    if (!clientWidth || !clientHeight) return;
    const key = `${clientWidth}x${clientHeight}@${ratio}`;
    if (key === this._size && !this._resize) return;
    this._size = key;
    this._resize = false;
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
  }

  /**
   * Draw a moment.
   * @param {import("./between.js").Between} between
   * @param {number} seconds since the last picture
   * @param {any} followed
   * @param {number} now milliseconds
   * @param {boolean} [always] whether also a picture that is as it was
   */
  draw(between, seconds, followed, now, always = false) {
    this.resize();
    const { before } = between;
    if (before) setLight(this.light, before.sky);
    this.light.time.value = now / 1000;
    this.cameras.update(seconds, followed);
    this.camera.updateMatrixWorld();
    const indoors = Boolean(followed) && followed.room >= 0 && this.cameras.mode !== "bird";
    if (before) {
      this.sky.update(before.sky, this.camera, indoors);
      this.people.update(between, this.camera, this.cameras.mode === "first" ? followed?.entity : 0);
      this.vehicles.update(between, this.camera, now);
      this.robots.update(between, this.camera, now);
      this.doors.update(between, this.camera);
    }
    if (!always && this._isStill(between, now)) return;
    this.city.showRoom(indoors ? followed.room : -1);
    this.happenings.group.visible = !indoors;
    this.city.update(this.camera);
    this.overlay.update();
    this._castShadows();
    this.renderer.render(this.scene, this.camera);
    this._count(now);
  }

  _castShadows() {
    if (!this.shade || !this.light.shaded) return;
    if (!this._trees && this.city.trees.length) {
      this.shade.addTrees(this.city.trees);
      this._trees = true;
    }
    this.shade.update();
  }

  /**
   * Whether the picture need not be drawn again. One that rests is drawn with all care, once, and then not any more.
   * @param {import("./between.js").Between} between
   * @param {number} now
   */
  _isStill(between, now) {
    const { elements } = this.camera.matrixWorld;
    const { ring, plan, names } = this.overlay;
    const key = `${between.time} ${elements.map((/** @type {number} */ v) => v.toFixed(2))} ${ring.position.x} ${ring.visible} ${plan.children.length} ${this.happenings.shown.length} ${names.size} ${this.canvas.clientWidth}x${this.canvas.clientHeight} ${this.city.arrived} ${this.people.arrived}`;
    if (key !== this._key || this._falls()) {
      this._key = key;
      this._moved = now;
      if (this._fine) {
        this._fine = false;
        this.setCare(this._careBefore);
        this.resize();
      }
      return false;
    }
    if (this._fine) return now - this._fineSince > 2500;
    if (now - this._moved > 450) {
      this._fine = true;
      this._fineSince = now;
      this._careBefore = this.care;
      this.setCare(Math.max(this.care, FINE));
      this.resize();
    }
    return false;
  }

  /** Whether rain or snow is on its way: then nothing rests. */
  _falls() {
    return this.sky.rain.visible || this.sky.snow.visible;
  }

  /** @param {number} now */
  _count(now) {
    const { render } = this.renderer.info;
    this.stats.triangles = render.triangles;
    this.stats.calls = render.calls;
    if (!this.stats.first && this.city.tiles.length) this.stats.first = now;
    this._frames++;
    if (now - this._since < 1500) return;
    this.stats.fps = (1000 * this._frames) / (now - this._since);
    this._since = now;
    this._frames = 0;
    if (!this.adapts || document.hidden || this._fine || now - this._moved > 400) return;
    if (this.stats.fps < GOAL * 0.85) this.setCare(this.care - 1);
    else if (this.stats.fps > GOAL * 1.6 && this.care < CARE.length - 1) this.setCare(this.care + 1);
  }

  /** Whether something in view is still on its way. */
  get pending() {
    return this.city.pending || this.people.pending > 0 || !this.vehicles.signals.known;
  }

  /** @param {string} [type] @returns {string} the picture as a data address */
  picture(type = "image/png") {
    return this.renderer.domElement.toDataURL(type);
  }
}
