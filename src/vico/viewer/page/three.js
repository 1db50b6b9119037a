// The 3D library, from the asset pack: absent where nobody has installed it, and then the page stays flat.

/** @type {any} */
export let THREE = null;

/**
 * Load the library.
 * @returns {Promise<boolean>} whether it is there
 */
export async function loadThree() {
  try {
    const answer = await fetch("three/index.js", { method: "HEAD" });
    if (!answer.ok) return false;
    ({ THREE } = await import("../three/index.js"));
    THREE.Object3D.DEFAULT_UP.set(0, 0, 1);
    THREE.ColorManagement.enabled = false;
    return true;
  } catch (error) {
    console.warn("no 3D library:", error);
    return false;
  }
}
