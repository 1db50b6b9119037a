// Textures: arrays of the pictures that surfaces are painted with, and the windows of far walls.

import { THREE } from "./three.js";

/**
 * Make a texture array whose layers come later: white until then.
 * @param {{width: number, height: number}} size
 * @param {number} layers
 * @param {Uint8Array} [data]
 * @param {boolean} [fine] whether colours pass from level to level: twice the work where no graphics card does it
 */
export function pictureArray(size, layers, data, fine = true) {
  const white = data ?? new Uint8Array(4).fill(255);
  const texture = data
    ? new THREE.DataArrayTexture(data, size.width, size.height, layers)
    : new THREE.DataArrayTexture(white, 1, 1, 1);
  texture.format = THREE.RGBAFormat;
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.magFilter = THREE.LinearFilter;
  texture.minFilter = !data ? THREE.LinearFilter : fine ? THREE.LinearMipmapLinearFilter : THREE.LinearMipmapNearestFilter;
  texture.generateMipmaps = Boolean(data);
  texture.needsUpdate = true;
  return texture;
}

/** Windows of far walls: so many across and up in the picture, metres of each, pixels of each. */
const [CELLS, CELL_WIDE, CELL_HIGH, CELL_PIXELS] = [8, 2.7, 3.5, 32];
/** Metres across and up of the picture of windows, as shaders want it. */
export const PANES = `vec2(${(CELLS * CELL_WIDE).toFixed(1)}, ${(CELLS * CELL_HIGH).toFixed(1)})`;

/**
 * Paint the windows of far walls: red is glass, green that behind which a lamp is lit at night.
 * @param {boolean} fine
 */
export function paneTexture(fine) {
  const side = CELLS * CELL_PIXELS;
  const data = new Uint8Array(2 * side * side);
  const covers = (/** @type {number} */ pixel, /** @type {number} */ low, /** @type {number} */ high) =>
    Math.min(Math.max(high * CELL_PIXELS - pixel, 0), 1) - Math.min(Math.max(low * CELL_PIXELS - pixel, 0), 1);
  for (let y = 0; y < side; y++) {
    for (let x = 0; x < side; x++) {
      const [i, j] = [Math.floor(x / CELL_PIXELS), Math.floor(y / CELL_PIXELS)];
      const glass = 255 * covers(x % CELL_PIXELS, 0.28, 0.74) * covers(y % CELL_PIXELS, 0.3, 0.8);
      const wild = Math.sin(i * 12.9898 + j * 78.233) * 43758.5453;
      data.set([glass, wild - Math.floor(wild) > 0.62 ? glass : 0], 2 * (y * side + x));
    }
  }
  const texture = new THREE.DataTexture(data, side, side, THREE.RGFormat);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.magFilter = THREE.LinearFilter;
  texture.minFilter = fine ? THREE.LinearMipmapLinearFilter : THREE.LinearMipmapNearestFilter;
  texture.generateMipmaps = true;
  texture.anisotropy = fine ? 4 : 1;
  texture.needsUpdate = true;
  return texture;
}
