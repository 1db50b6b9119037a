import { loadThree } from "./three.js";
import { Source } from "./source.js";
import { Between } from "./between.js";
import { Clock } from "./clock.js";
await loadThree();
const { View } = await import("./view.js");
const source = new Source(); await source.reload();
const view = new View(document.getElementById("scene"), source);
const clock = new Clock(); clock.first = source.timeOf(0); clock.last = source.timeOf(source.last); clock.time = clock.first; clock.playing = true;
view.vehicles.people = view.people;
const between = new Between();
await view.open();
let last = performance.now();
function tick(now) {
  const dt = Math.min((now - last) / 1000, 0.5); last = now;
  clock.advance(dt);
  const [a, b, s] = source.around(source.stepAt(clock.time));
  if (a && b) between.set(a, b, s);
  view.draw(between, dt, null, now);
  requestAnimationFrame(tick);
}
requestAnimationFrame(tick);
window.vico = { view, source, clock, between };
