// Decodes the pictures of the texture arrays off the page's own thread.

self.onmessage = async (/** @type {MessageEvent} */ message) => {
  const { buffer, textures, arrays } = message.data;
  /** @type {Map<string, OffscreenCanvas>} */
  const canvases = new Map();
  for (let number = 0; number < arrays.length; number++) {
    const { width, height } = arrays[number];
    const own = textures.filter((/** @type {any} */ t) => t.array === number);
    const layers = Math.max(0, ...own.map((/** @type {any} */ t) => t.layer + 1));
    const data = new Uint8Array(width * height * 4 * Math.max(layers, 1));
    for (const entry of own) {
      const blob = new Blob([new Uint8Array(buffer, entry.offset, entry.size)]);
      const picture = await createImageBitmap(blob, { colorSpaceConversion: "none" });
      const key = `${width}x${height}`;
      const canvas = canvases.get(key) ?? new OffscreenCanvas(width, height);
      canvases.set(key, canvas);
      const context = /** @type {any} */ (canvas.getContext("2d", { willReadFrequently: true }));
      context.drawImage(picture, 0, 0);
      const pixels = context.getImageData(0, 0, width, height).data;
      const start = entry.layer * width * height * 4;
      if (entry.what === "colour") {
        data.set(pixels, start);
      } else for (let k = 0; k < pixels.length; k += 4) data[start + k + 3] = pixels[k];
    }
    /** @type {any} */ (self).postMessage({ number, width, height, layers, data }, [data.buffer]);
  }
};
