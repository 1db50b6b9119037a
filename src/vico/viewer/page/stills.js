// Pictures of a moment for papers and films: the same scene, drawn once everything in view is there.

/**
 * @typedef {object} Wish
 * @property {number} time seconds since midnight of the first day
 * @property {number} [entity] who is followed, 0 for nobody
 * @property {"orbit" | "follow" | "first" | "bird"} [mode]
 * @property {{x: number, y: number, z: number}} [target] what is looked at, where nobody is followed
 * @property {number} [yaw] radians
 * @property {number} [turn] radians to the left of where who is followed faces
 * @property {number} [pitch] radians
 * @property {number} [distance] metres
 * @property {number} [seconds] since the picture before, of a film
 * @property {string} [type] of the picture: image/png or image/jpeg
 */

const LATEST = 60_000;
const SETTLED = 3;

/**
 * Take over the picture: nothing else is drawn any more.
 * @param {any} page
 */
export async function begin(page) {
  await page.timeline.loaded;
  page.frozen = true;
  document.body.classList.add("bare");
  page.view.adapts = false;
  page.view.setCare(5);
}

/**
 * Draw a moment and return the picture.
 * @param {any} page
 * @param {Wish} wish
 * @returns {Promise<string>} as a data address
 */
export async function still(page, wish) {
  const { source, between, view } = page;
  const until = performance.now() + LATEST;
  const pause = () => new Promise((resolve) => setTimeout(resolve, 15));
  page.clock.time = wish.time;
  for (;;) {
    const [before, after, share] = source.around(source.stepAt(wish.time));
    if (before && after) {
      between.set(before, after, share);
      break;
    }
    if (performance.now() > until) throw new Error(`the step at ${wish.time} s did not come`);
    await pause();
  }
  page.selected = wish.entity ?? 0;
  page.showHappenings();
  aim(view.cameras, wish);
  const followed = page.followed();
  // A first picture has no way behind it: the camera is where it would have come to rest.
  let seconds = wish.seconds ?? 30;
  for (let settled = 0; settled < SETTLED; ) {
    view.overlay.select(null);
    view.draw(between, seconds, followed, wish.time * 1000, true);
    seconds = 0;
    settled = view.pending ? 0 : settled + 1;
    if (performance.now() > until) throw new Error("the city did not come");
    if (view.pending) await pause();
    else if (wish.seconds !== undefined) break;
  }
  return view.picture(wish.type ?? "image/png");
}

/** @param {any} cameras @param {Wish} wish */
function aim(cameras, wish) {
  if (wish.mode) cameras.setMode(wish.mode);
  if (wish.target) cameras.target.set(wish.target.x, wish.target.y, wish.target.z);
  if (wish.yaw !== undefined) cameras.yaw = wish.yaw;
  if (wish.turn !== undefined) cameras._relative = wish.turn;
  if (wish.pitch !== undefined) cameras.pitch = wish.pitch;
  if (wish.distance !== undefined) cameras.distance = wish.distance;
}
