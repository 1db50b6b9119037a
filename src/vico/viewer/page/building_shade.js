// Shadows of buildings and trees: for every place the height up to which it lies in shadow, seen from above. Made once
// for a place of the sun; what is lower than that is in the shade, be it ground, wall or person.

import { THREE } from "./three.js";

/** The sun's place is rounded to this, radians: the same shadows for the same minutes. */
const STEP = Math.PI / 180;
/** Lower suns cast shadows as long as this one. */
const LOWEST_SLOPE = 0.06;
/** Suns that give less light than this cast none. */
const FAINTEST = 0.12;
/** Heights are told from so far below the ground, metres: what nothing shades is above 0. */
const BELOW = 3;
/** What lies below crowns of trees is in the shade up to so high, metres. */
const BELOW_CROWNS = 2.2;

const EDGE_VERTEX = /* glsl */ `
attribute float end;
uniform vec2 way;
uniform float slope, low, top, halfSide;
varying float vHeight;
void main() {
  float drop = max(position.z - low, 0.0) * end;
  vHeight = position.z - drop - low;
  gl_Position = vec4((position.xy + way * drop / slope) / halfSide, 1.0 - 2.0 * vHeight / top, 1.0);
}`;
const EDGE_FRAGMENT = /* glsl */ `
varying float vHeight;
void main() { gl_FragColor = vec4(vHeight, 0.0, 0.0, 1.0); }`;

const CROWN_VERTEX = /* glsl */ `
attribute vec4 tree;
attribute vec2 crown;
uniform vec2 way;
uniform float slope, low, top, halfSide;
varying vec2 vAt, vSeed;
varying float vHeight;
void main() {
  vec2 middle = tree.xy + way * crown.x / slope;
  vec2 off = way * position.x * length(vec2(crown.y, crown.y / slope)) + vec2(-way.y, way.x) * position.y * crown.y;
  vAt = position.xy;
  vSeed = off + tree.xy;
  vHeight = tree.z - low + ${BELOW_CROWNS.toFixed(1)};
  gl_Position = vec4((middle + off) / halfSide, 1.0 - 2.0 * vHeight / top, 1.0);
}`;
// A crown lets some light through, the more the nearer to its rim.
const CROWN_FRAGMENT = /* glsl */ `
varying vec2 vAt, vSeed;
varying float vHeight;
void main() {
  float wild = fract(sin(dot(floor(vSeed * 1.6), vec2(12.9898, 78.233))) * 43758.5453);
  if (length(vAt) + 0.35 * wild > 1.05) discard;
  gl_FragColor = vec4(vHeight, 0.0, 0.0, 1.0);
}`;

export class BuildingShade {
  /**
   * @param {any} renderer
   * @param {import("./light.js").Light} light
   * @param {{half: number, low: number, side: number}} frame half side of the city and its lowest height, metres; pixels
   */
  constructor(renderer, light, { half, low, side }) {
    this.renderer = renderer;
    this.light = light;
    this.half = half;
    this.side = side;
    this.uniforms = { way: { value: new THREE.Vector2(1, 0) }, slope: { value: 1 }, low: { value: low - BELOW }, top: { value: 400 }, halfSide: { value: half } };
    this.scene = new THREE.Scene();
    this.camera = new THREE.Camera();
    this._key = "";
    // Where halves of floats cannot be painted on there are no shadows.
    this.can = renderer.extensions.has("EXT_color_buffer_float") || renderer.extensions.has("EXT_color_buffer_halfSidefloat");
    if (!this.can) return;
    this.target = new THREE.WebGLRenderTarget(side, side, {
      format: THREE.RedFormat, type: THREE.HalfFloatType, minFilter: THREE.LinearFilter, magFilter: THREE.LinearFilter, generateMipmaps: false,
    });
    light.shade.value = this.target.texture;
  }

  /** @param {any[]} geometries walls and roofs from afar */
  addBuildings(geometries) {
    const ends = geometries.map(roofEdges);
    const count = ends.reduce((sum, part) => sum + part.length / 6, 0);
    const position = new Float32Array(12 * count);
    const end = new Float32Array(4 * count);
    const index = new Uint32Array(6 * count);
    let edge = 0;
    for (const part of ends) {
      for (let k = 0; k < part.length; k += 6, edge++) {
        position.set(part.slice(k, k + 6), 12 * edge);
        position.set(part.slice(k, k + 6), 12 * edge + 6);
        end.set([0, 0, 1, 1], 4 * edge);
        const v = 4 * edge;
        index.set([v, v + 1, v + 2, v + 1, v + 3, v + 2], 6 * edge);
      }
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(position, 3));
    geometry.setAttribute("end", new THREE.BufferAttribute(end, 1));
    geometry.setIndex(new THREE.BufferAttribute(index, 1));
    this._add(new THREE.Mesh(geometry, this._material(EDGE_VERTEX, EDGE_FRAGMENT)));
  }

  /**
   * @param {{at: Float32Array, middle: number, radius: number}[]} kinds of each kind of tree where they stand (rows of
   *   x, y, z, yaw, scale), how high the middle of the crown is and how large it is, metres
   */
  addTrees(kinds) {
    const count = kinds.reduce((sum, { at }) => sum + at.length / 5, 0);
    if (!count) return;
    const tree = new Float32Array(4 * count);
    const crown = new Float32Array(2 * count);
    let row = 0;
    for (const { at, middle, radius } of kinds) {
      for (let k = 0; k < at.length; k += 5, row++) {
        tree.set([at[k], at[k + 1], at[k + 2], 0], 4 * row);
        crown.set([middle * at[k + 4], radius * at[k + 4]], 2 * row);
      }
    }
    const geometry = new THREE.InstancedBufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array([-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0]), 3));
    geometry.setAttribute("tree", new THREE.InstancedBufferAttribute(tree, 4));
    geometry.setAttribute("crown", new THREE.InstancedBufferAttribute(crown, 2));
    geometry.setIndex([0, 1, 2, 0, 2, 3]);
    this._add(new THREE.Mesh(geometry, this._material(CROWN_VERTEX, CROWN_FRAGMENT)));
  }

  /** @param {string} vertexShader @param {string} fragmentShader */
  _material(vertexShader, fragmentShader) {
    return new THREE.ShaderMaterial({ uniforms: this.uniforms, vertexShader, fragmentShader, side: THREE.DoubleSide });
  }

  /** @param {any} mesh */
  _add(mesh) {
    mesh.frustumCulled = false;
    this.scene.add(mesh);
    this._key = "";
  }

  /** Have the shadows be those of the sun that there is; nothing is done where it has hardly moved. */
  update() {
    if (!this.can || !this.scene.children.length) return;
    const { sun, sunColour, shadeFrame } = this.light;
    const isFaint = Math.max(sunColour.value.r, sunColour.value.g, sunColour.value.b) < FAINTEST || sun.value.z <= 0;
    const height = Math.max(Math.round(Math.asin(Math.min(sun.value.z, 1)) / STEP), 1);
    const round = Math.round(Math.atan2(sun.value.y, sun.value.x) / STEP);
    const key = isFaint ? "faint" : `${height} ${round}`;
    if (key === this._key) return;
    this._key = key;
    const { uniforms, renderer, half, side } = this;
    const [c, s] = [Math.cos(round * STEP), Math.sin(round * STEP)];
    uniforms.way.value.set(-c, -s);
    uniforms.slope.value = Math.max(Math.tan(Math.min(height * STEP, 1.55)), LOWEST_SLOPE);
    // A wall in the sun is not to stand in its own shadow: one looks a pixel and a half nearer to the sun.
    const shift = (3 * half) / side;
    shadeFrame.value.set(1 / (2 * half), c * shift, s * shift, uniforms.low.value);
    const before = [renderer.getRenderTarget(), renderer.getClearColor(new THREE.Color()), renderer.getClearAlpha()];
    renderer.setRenderTarget(this.target);
    renderer.setClearColor(0x000000, 1);
    renderer.clear();
    if (!isFaint) renderer.render(this.scene, this.camera);
    renderer.setRenderTarget(before[0]);
    renderer.setClearColor(before[1], before[2]);
  }
}

/**
 * Return the rims of what faces up: edges that only one such triangle has.
 * @param {any} geometry
 * @returns {number[]} x, y, z of both ends of each
 */
export function roofEdges(geometry) {
  const { position, facing } = geometry.attributes;
  const index = geometry.index.array;
  const at = (/** @type {number} */ v) => `${Math.round(position.array[3 * v] * 50)} ${Math.round(position.array[3 * v + 1] * 50)} ${Math.round(position.array[3 * v + 2] * 50)}`;
  /** @type {Map<string, [number, number] | null>} */
  const edges = new Map();
  for (let k = 0; k < index.length; k += 3) {
    if (facing.array[4 * index[k] + 2] < 25) continue;
    for (let e = 0; e < 3; e++) {
      const a = index[k + e];
      const b = index[k + ((e + 1) % 3)];
      const [p, q] = [at(a), at(b)];
      const key = p < q ? `${p} ${q}` : `${q} ${p}`;
      edges.set(key, edges.has(key) ? null : [a, b]);
    }
  }
  /** @type {number[]} */
  const found = [];
  for (const edge of edges.values()) {
    if (edge) for (const v of edge) found.push(position.array[3 * v], position.array[3 * v + 1], position.array[3 * v + 2]);
  }
  return found;
}
