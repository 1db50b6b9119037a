"""The page in a real browser, on a recorded run: what is drawn, chosen, sought and found."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from vico.sim.recording import read_run
from vico.viewer.headless import BrowserPage, open_page

_AT = "vico.source.stepAt(vico.clock.time)"


def test_the_city_and_its_people_are_drawn(page: BrowserPage) -> None:
    page.wait_for("vico.view.stats.triangles > 3000 && vico.view.people.drawn > 0", seconds=60)
    assert page.faults == []
    assert page.evaluate("vico.view.city.tiles.length") > 1


def test_what_is_drawn_is_where_it_was_recorded(page: BrowserPage, page_run: Path) -> None:
    page.evaluate("vico.clock.seek(vico.source.timeOf(12))")
    page.wait_for("vico.state.time === vico.source.timeOf(12)")
    drawn = dict(page.evaluate("[...vico.state.bodies].map(([e, b]) => [e, [b.x, b.y, b.z]])"))
    moment = read_run(page_run).at(12)
    recorded = dict(zip(moment.entity.tolist(), moment.position.tolist(), strict=True))
    assert drawn.keys() == recorded.keys()
    assert all(drawn[e] == pytest.approx(recorded[e], abs=2e-3) for e in recorded)


def _screen(page: BrowserPage, entity: int) -> tuple[float, float]:
    script = f"""(() => {{
      const b = vico.state.bodies.get({entity}), box = document.getElementById("scene").getBoundingClientRect();
      const at = vico.cameras.target.clone().set(b.x, b.y, b.z + 1).project(vico.camera);
      return [box.left + (at.x + 1) / 2 * box.width, box.top + (1 - at.y) / 2 * box.height];
    }})()"""
    x, y = page.evaluate(script)
    return float(x), float(y)


def test_a_click_on_somebody_tells_who_it_is(page: BrowserPage) -> None:
    outdoors = "[...vico.state.before.people.entity].find((e) => !vico.state.before.rows.agents.has(e))"
    entity = int(page.evaluate(outdoors))
    page.evaluate(f"""(() => {{ const b = vico.state.bodies.get({entity}); vico.select(0);
      vico.cameras.setMode("orbit"); vico.cameras.lookAt(b.x, b.y, b.z + 1, 12); }})()""")
    page.wait_for(f"Boolean(vico.view.people.known.get({entity})?.group)")
    page.evaluate("new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
    page.click(*_screen(page, entity))
    page.wait_for(f"vico.page.selected === {entity}")
    words = page.evaluate("document.getElementById('who').textContent")
    assert "pedestrian" in words or "cyclist" in words


def test_the_panel_tells_what_a_resident_does_and_sees(page: BrowserPage, page_run: Path) -> None:
    agent = read_run(page_run).agents[0]
    page.evaluate(f"vico.clock.seek(vico.source.timeOf(20)), vico.select({agent['entity']})")
    name = json.dumps(agent["person"]["name"])
    page.wait_for(f"document.querySelector('#who h2').textContent === {name}")
    page.wait_for("document.querySelector('#who .picture img')?.naturalWidth > 100")
    words = page.evaluate("document.getElementById('who').innerText")
    assert agent["person"]["schedule"][0]["activity"] in words
    assert "Outcome" in words
    assert "Knows" in words
    page.evaluate("document.querySelector('[data-lens=segmentation]').click()")
    page.wait_for("document.querySelectorAll('#who .names li').length > 1")


def test_keys_step_play_and_choose(page: BrowserPage) -> None:
    page.evaluate("vico.clock.seek(vico.source.timeOf(5)), document.getElementById('scene').focus()")
    page.press(".", "Period")
    assert page.evaluate(_AT) == pytest.approx(6)
    page.press(",", "Comma")
    assert page.evaluate(_AT) == pytest.approx(5)
    page.press(" ", "Space")
    page.wait_for(f"{_AT} > 5.2")
    page.press(" ", "Space")
    assert page.evaluate("vico.clock.playing") is False
    page.press("n", "KeyN")
    assert page.evaluate("vico.page.selected") > 0
    page.press("Escape", "Escape")
    assert page.evaluate("vico.page.selected") == 0
    page.press("?", "Slash")
    assert page.evaluate("document.getElementById('help').open") is True
    page.evaluate("document.getElementById('help').close()")


def test_the_slider_seeks(page: BrowserPage) -> None:
    page.evaluate(
        "(() => { const s = document.getElementById('seek'); s.value = 30;s.dispatchEvent(new Event('input')); })()"
    )
    page.wait_for("vico.state.before.step === 30")


def test_a_click_on_the_map_chooses_who_is_there(page: BrowserPage) -> None:
    page.evaluate("vico.select(0), vico.page.resizeMap()")
    page.wait_for("vico.page.map.scale > 0 && document.getElementById('map').clientWidth > 300")
    entity, x, y = page.evaluate("""(() => {
      const m = vico.page.map, box = m.canvas.getBoundingClientRect(); m.scale = 8;
      const e = vico.source.run.agents.find((a) => a.kind === "robot").entity, b = vico.state.bodies.get(e);
      m.x = b.x; m.y = b.y; return [e, box.left + box.width / 2, box.top + box.height / 2]; })()""")
    page.click(x, y)
    page.wait_for(f"vico.page.selected === {entity}")
    page.evaluate("vico.page.resizeMap(), vico.page.resizeMap()")


def test_search_finds_people_and_goes_there(page: BrowserPage, page_run: Path) -> None:
    agent = read_run(page_run).agents[1]
    surname = agent["person"]["name"].split()[-1]
    page.evaluate(
        f"(() => {{ const f = document.getElementById('search'); f.value = {json.dumps(agent['person']['name'])};"
        "f.dispatchEvent(new Event('input')); })()"
    )
    assert surname in page.wait_for("document.querySelector('#hits button')?.textContent")
    page.evaluate("document.querySelector('#hits button').click()")
    page.wait_for(f"vico.page.selected === {agent['entity']}")


def test_metrics_and_events_are_shown(page: BrowserPage) -> None:
    page.evaluate("vico.page.openTab('metrics')")
    page.wait_for("document.querySelector('#metrics strong').textContent !== '–'")
    page.evaluate("vico.page.openTab('events')")
    page.wait_for("document.querySelectorAll('#log li').length > 0")
    page.evaluate("vico.page.openTab('who')")


@pytest.mark.parametrize("mode", ["orbit", "follow", "first", "bird"])
def test_cameras_look_at_whoever_is_chosen(page: BrowserPage, mode: str) -> None:
    robot = "vico.source.run.agents.find((a) => a.kind === 'robot').entity"
    page.evaluate(f"vico.select({robot}), vico.page.setMode({json.dumps(mode)})")
    page.wait_for("performance.now() > 0")
    near = f"""(() => {{ const b = vico.state.bodies.get({robot}), p = vico.camera.position;
      const at = vico.cameras.target.clone().set(b.x, b.y, b.z + 0.3).project(vico.camera);
      if ({json.dumps(mode)} === "first") return Math.hypot(p.x - b.x, p.y - b.y) < 1.5;
      return Math.abs(at.x) < 0.5 && Math.abs(at.y) < 0.8; }})()"""
    page.wait_for(near, seconds=20)
    page.evaluate("vico.select(0), vico.page.setMode('orbit')")


@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("width", [360, 800, 1600])
def test_nothing_is_wider_than_the_window(page: BrowserPage, width: int, dark: bool) -> None:
    page.resize(width, 720, dark=dark)
    page.evaluate("new Promise((resolve) => setTimeout(resolve, 150))")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    beyond = page.evaluate("""[...document.querySelectorAll('button, input, select, h2')].filter((e) => e.offsetParent
      && e.getBoundingClientRect().right > innerWidth + 1).map((e) => e.id || e.textContent)""")
    assert beyond == []
    page.resize(1000, 640)


def test_everything_that_can_be_pressed_has_a_name(page: BrowserPage) -> None:
    nameless = page.evaluate("""[...document.querySelectorAll('button, input, select')].filter((e) => !(e.ariaLabel
      || e.title || e.textContent.trim() || e.labels?.length)).map((e) => e.outerHTML.slice(0, 80))""")
    assert nameless == []


def test_a_page_without_the_token_is_refused(address: str) -> None:
    with open_page() as stranger:
        stranger.go_to(address.partition("?")[0])
        assert stranger.evaluate("Boolean(window.vico)") is False
        assert "token" in stranger.evaluate("document.body.innerText").lower()


def test_no_file_of_the_page_names_another_host() -> None:
    folder = Path(__file__).parents[3] / "src" / "vico" / "viewer" / "page"
    found: list[Any] = [
        (path.name, word)
        for path in folder.iterdir()
        for word in ("http://", "https://", "//cdn")
        if path.suffix in (".js", ".css", ".html") and word in path.read_text()
    ]
    assert found == []


def test_two_fingers_bring_the_picture_nearer(page: BrowserPage) -> None:
    page.evaluate("vico.cameras.setMode('orbit'), vico.cameras.distance = 80, window.yaw = vico.cameras.yaw")
    page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)

    def touch(kind: str, *at: tuple[float, float]) -> None:
        fingers = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(at)]
        page.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)

    touch("touchStart", (300, 300))
    touch("touchMove", (340, 300))
    assert page.evaluate("vico.cameras.yaw - yaw") == pytest.approx(-0.24, abs=0.1)
    touch("touchEnd")
    touch("touchStart", (300, 300), (360, 300))
    touch("touchMove", (270, 300), (390, 300))
    touch("touchEnd")
    page.call("Emulation.setTouchEmulationEnabled", enabled=False)
    assert page.evaluate("vico.cameras.distance") == pytest.approx(40, rel=0.1)


def test_walls_cast_shadows_where_the_sun_does_not_come(page: BrowserPage) -> None:
    found = page.evaluate("""(() => {
      const { view } = vico;
      view.setCare(4);
      view.draw(vico.state, 0.03, null, 1000, true);
      const { shade, light } = view, { side, half } = shade;
      if (!shade.can) return null;
      const heights = new Uint16Array(side * side);
      view.renderer.readRenderTargetPixels(shade.target, 0, 0, side, side, heights);
      const pixel = (v) => Math.floor((v / half + 1) / 2 * side);
      const at = (x, y) => heights[pixel(y) * side + pixel(x)];
      // Just outside of each building, away from the sun and towards it.
      const { x, y } = light.sun.value, [sx, sy] = [x, y].map((v) => v / Math.hypot(x, y));
      let behind = 0, before = 0, count = 0;
      for (const { ring } of view.city.manifest.buildings) {
        const far = (a, b) => (a[0] * sx + a[1] * sy < b[0] * sx + b[1] * sy ? a : b);
        const near = (a, b) => (far(a, b) === a ? b : a);
        const [f, n] = [ring.reduce(far), ring.reduce(near)];
        behind += at(f[0] - 3 * sx, f[1] - 3 * sy) > 0;
        before += at(n[0] + 3 * sx, n[1] + 3 * sy) > 0;
        count++;
      }
      view.setCare(1);
      return { up: light.sun.value.z, behind: behind / count, before: before / count };
    })()""")
    if found is None:
        pytest.skip("this browser paints no halves of floats: there are no shadows")
    assert found["up"] > 0.1
    assert found["behind"] > 0.6
    assert found["before"] < found["behind"] - 0.1


def test_a_shape_stands_for_who_is_on_the_way(page: BrowserPage) -> None:
    page.evaluate("vico.clock.seek(vico.clock.first), vico.page.setMode('orbit')")
    page.wait_for("vico.view.people.drawn > 0 && !vico.view.people.pending", seconds=60)
    shapes = page.evaluate("""(() => {
      const { people, camera } = vico.view;
      const known = people.known;
      people.known = new Map();
      people._fetch = () => {};
      people.update(vico.state, camera);
      const waiting = [people.standIns.count, people.drawn];
      people.known = known;
      delete people._fetch;
      people.update(vico.state, camera);
      return [...waiting, people.standIns.count, people.drawn];
    })()""")
    assert shapes[0] > 0
    assert shapes == [shapes[0], 0, 0, shapes[0]]


def test_lamps_of_rooms_light_whoever_is_in_one(page: BrowserPage) -> None:
    lit = page.evaluate("""import('./page/person_material.js').then(({ lightBy }) => {
      const { light, people } = vico.view;
      const { material } = people.standIns;
      return [true, false].map((indoors) => {
        lightBy(light, material, indoors);
        return material.uniforms.sky === light.sky;
      });
    })""")
    assert lit == [False, True]


def test_a_camera_that_follows_keeps_off_walls(page: BrowserPage) -> None:
    distance = page.evaluate("""(() => {
      const { cameras } = vico;
      const { sight } = cameras;
      cameras.sight = (from, way, reach) => Math.min(reach, 2);
      const near = cameras._free(0, 7);
      cameras.sight = sight;
      return near;
    })()""")
    assert 1.5 < distance < 2.0
