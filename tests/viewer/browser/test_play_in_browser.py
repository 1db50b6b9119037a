"""Somebody plays in a real browser: keys walk and are let go, refusals are said, words are heard."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from vico.sim.recording import read_run
from vico.viewer.headless import BrowserPage, open_page

_PLACE = "vico.play.you.position"


@pytest.fixture(scope="module")
def played(
    browser: None, library: None, helsinki_path: Path, helsinki_people: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[BrowserPage, Path]]:
    """A page of `vico play`, and the run's folder."""
    out = tmp_path_factory.mktemp("played") / "run"
    few = ["--cars", "3", "--pedestrians", "3", "--view", "none"]
    words = [sys.executable, "-m", "vico.cli.main", "play", str(helsinki_path), str(helsinki_people), *few]
    with subprocess.Popen(
        [*words, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    ) as game:
        try:
            assert game.stdout is not None
            line = game.stdout.readline()
            with open_page() as page:
                page.resize(640, 400)
                page.go_to(line.split()[-1])
                page.wait_for("window.vico?.play?.you", seconds=90)
                yield page, out
        finally:
            game.terminate()


def _hold(page: BrowserPage, key: str, code: str, *, down: bool) -> None:
    page.call("Input.dispatchKeyEvent", type="keyDown" if down else "keyUp", key=key, code=code)


def test_arrows_walk_as_long_as_they_are_held(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    page.evaluate(f"window.start = {_PLACE}.slice()")
    _hold(page, "ArrowUp", "ArrowUp", down=True)
    page.wait_for(f"Math.hypot({_PLACE}[0] - start[0], {_PLACE}[1] - start[1]) > 0.4", seconds=60)
    _hold(page, "ArrowUp", "ArrowUp", down=False)
    page.wait_for("vico.play.you.speed === 0", seconds=60)
    assert page.faults == []


def test_keys_are_let_go_when_the_window_loses_the_focus(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    _hold(page, "ArrowLeft", "ArrowLeft", down=True)
    page.wait_for("vico.play.input.message().down.length === 1")
    page.evaluate("window.dispatchEvent(new Event('blur'))")
    assert page.evaluate("vico.play.input.message().down.length") == 0
    _hold(page, "ArrowLeft", "ArrowLeft", down=False)


def _touch(page: BrowserPage, kind: str, *points: tuple[float, float]) -> None:
    fingers = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
    page.call("Input.dispatchTouchEvent", type=kind, touchPoints=fingers)


def test_a_finger_on_the_left_walks_and_one_on_the_right_looks(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    page.call("Emulation.setTouchEmulationEnabled", enabled=True, maxTouchPoints=2)
    # Touches are answered between two pictures: without a graphics card there are none meanwhile.
    page.evaluate("vico.page.frozen = true")
    page.evaluate(f"window.start = {_PLACE}.slice()")
    _touch(page, "touchStart", (120, 300))
    _touch(page, "touchMove", (120, 250))
    page.wait_for("Math.abs(vico.play.input._stick.y - 50 / 60) < 0.02")
    # Until a finger leads the gaze, it comes round behind the body.
    page.wait_for("vico.play.input.looks")
    page.evaluate("window.yaw = vico.play.input.yaw")
    _touch(page, "touchStart", (120, 250), (450, 200))
    _touch(page, "touchMove", (120, 250), (350, 200))
    page.wait_for("Math.abs(vico.play.input.yaw - yaw - 0.32) < 0.05")
    page.wait_for(f"Math.hypot({_PLACE}[0] - start[0], {_PLACE}[1] - start[1]) > 0.3", seconds=60)
    _touch(page, "touchMove", (120, 190), (350, 200))
    page.wait_for("vico.play.input.message().down.join() === 'run'")
    _touch(page, "touchEnd")
    page.wait_for("vico.play.you.speed === 0 && !vico.play.input.message().down.length", seconds=60)
    page.call("Emulation.setTouchEmulationEnabled", enabled=False)
    page.evaluate("vico.page.frozen = false, requestAnimationFrame((now) => vico.page._tick(now))")
    assert page.faults == []


_PAD = """(() => {
  const button = (pressed) => ({ pressed, value: Number(pressed) });
  const buttons = Array.from({ length: 17 }, (_, k) => button(PRESSED.includes(k)));
  navigator.getGamepads = () => [null, { axes: AXES, buttons, mapping: "standard" }];
})()"""


def _pad(page: BrowserPage, axes: list[float], *pressed: int) -> None:
    page.evaluate(_PAD.replace("PRESSED", repr(list(pressed))).replace("AXES", repr(axes)))


def test_a_gamepad_walks_looks_runs_and_does_what_is_at_hand(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    page.evaluate(f"window.start = {_PLACE}.slice()")
    _pad(page, [0.0, -1.0, 0.0, 0.0], 1)
    page.wait_for(f"Math.hypot({_PLACE}[0] - start[0], {_PLACE}[1] - start[1]) > 0.4", seconds=60)
    assert page.evaluate("vico.play.input.message()")["down"] == ["run"]
    _pad(page, [0.0, 0.0, 1.0, 0.0])
    page.evaluate("window.yaw = vico.play.input.yaw")
    page.wait_for("vico.play.input.yaw < yaw - 0.2", seconds=30)
    page.evaluate("window.asked = [], vico.play.input.onButton = (key) => asked.push(key)")
    _pad(page, [0.0, 0.05, 0.0, 0.0], 0, 3)
    page.wait_for("asked.length === 2")
    page.evaluate("new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
    assert page.evaluate("asked") == ["first", ">"]
    assert page.evaluate("vico.play.input.axes") == {}
    page.evaluate("vico.play.input.onButton = (key) => vico.play._button(key), delete navigator.getGamepads")
    page.wait_for("vico.play.you.speed === 0", seconds=60)
    assert page.faults == []


def test_what_is_refused_is_said(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    page.press("m", "KeyM")
    page.wait_for("/no bus or tram/.test(document.getElementById('toast').textContent)", seconds=60)


def test_what_is_typed_is_said_in_the_street(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    page.evaluate("""(() => {
      const chat = document.querySelector(".play-chat");
      chat.value = "Good morning";
      chat.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter", bubbles: true }));
    })()""")
    said = (
        "fetch('/api/search?q=Good morning').then((a) => a.json()).then((f) => f.hits.some((h) => h.what === 'event'))"
    )
    page.wait_for(said, seconds=60)


def test_what_nobody_hears_is_said_to_be_so(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    data = "{ hearers: [], missed: { resident_1: 'noise' } }"
    event = f"{{ kind: 'message', agent: vico.play.name, time: 0, text: 'Hello?', data: {data} }}"
    page.evaluate(f"vico.source._tell('events', {{ events: [{event}] }})")
    assert "nobody heard it: it is too loud here" in page.evaluate("document.querySelector('.play-heard').textContent")
    assert "Nobody heard it" in page.evaluate("document.getElementById('toast').textContent")


def test_the_question_mark_shows_the_keys_of_the_game_and_keeps_them_from_the_body(
    played: tuple[BrowserPage, Path],
) -> None:
    page, _ = played
    keys = "document.querySelector('#help dl').textContent"
    page.press("?", "Slash")
    page.wait_for("document.getElementById('help').open")
    assert "go through a door" in page.evaluate(keys)
    _hold(page, "ArrowUp", "ArrowUp", down=True)
    assert page.evaluate("vico.play.input.message().down") == []
    _hold(page, "ArrowUp", "ArrowUp", down=False)
    page.press("?", "Slash")
    page.wait_for("!document.getElementById('help').open && vico.play.active")
    page.evaluate("document.getElementById('help-button').click()")
    assert "go through a door" in page.evaluate(keys)
    page.press("Escape", "Escape")
    page.wait_for("!document.getElementById('help').open && vico.play.active")


def test_the_camera_is_behind_the_own_body_and_escape_lets_go(played: tuple[BrowserPage, Path]) -> None:
    page, _ = played
    page.wait_for("vico.cameras.mode === 'play'")
    body = "vico.state.bodies.get(vico.play.entity)"
    away = f"(({{x, y, z}}) => vico.camera.position.distanceTo({{x, y, z}}))({body})"
    assert float(page.evaluate(away)) < 6.0
    page.press("Escape", "Escape")
    page.wait_for("vico.cameras.mode !== 'play' && !vico.play.active")
    page.evaluate("document.querySelector('.play-again').click()")
    page.wait_for("vico.cameras.mode === 'play' && vico.play.active")


def test_what_was_played_is_recorded_ten_times_a_second(played: tuple[BrowserPage, Path]) -> None:
    page, out = played
    _hold(page, "ArrowUp", "ArrowUp", down=True)
    page.wait_for("vico.play.you.speed > 0", seconds=60)
    _hold(page, "ArrowUp", "ArrowUp", down=False)
    # A segment is on the disk after sixty steps; what was just done is in the next one at the latest.
    page.evaluate("window.step = vico.play.you.step")
    page.wait_for("vico.play.you.step > step + 125", seconds=120)
    run = read_run(out)
    assert run.times[10] - run.times[0] == pytest.approx(1.0)
    assert any(record.action and record.action["type"] == "move_forward" for record in _of(run))


def _of(run):  # type: ignore[no-untyped-def]
    return [run.at(step).agents["assistant_0"] for step in range(1, run.last + 1)]
