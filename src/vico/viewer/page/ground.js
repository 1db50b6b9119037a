// What both the map and the 3D picture show of a city: its index, and the ground painted from above.

import { getJson } from "./source.js";

/** @typedef {{manifest: any, picture: HTMLCanvasElement}} CityBase */

/** @returns {Promise<CityBase>} */
export async function loadCityBase() {
  const [manifest, answer] = await Promise.all([getJson("city/manifest.json"), fetch("city/ground.jpg")]);
  if (!answer.ok) throw new Error("the picture of the ground is missing");
  const bitmap = await createImageBitmap(await answer.blob());
  const picture = document.createElement("canvas");
  picture.width = bitmap.width;
  picture.height = bitmap.height;
  /** @type {CanvasRenderingContext2D} */ (picture.getContext("2d")).drawImage(bitmap, 0, 0);
  return { manifest, picture };
}
