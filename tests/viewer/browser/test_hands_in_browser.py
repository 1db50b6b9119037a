"""Hands in a run that goes on, by the page itself: hold it up, step, pace, weather, bookmarks, a closed road."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

from live_toy import LiveToy, live_toy
from vico.sim.environment import weather_kinds
from vico.sim.recording.interventions import read_interventions
from vico.viewer.headless import BrowserPage, open_page


@pytest.fixture(scope="module")
def toy(browser: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveToy]:
    """A run of the toy city that goes on."""
    with live_toy(tmp_path_factory.mktemp("hands") / "run") as running:
        running.control.command("speed", {"factor": 2.0})
        yield running


@pytest.fixture(scope="module")
def live(toy: LiveToy) -> Iterator[BrowserPage]:
    """Its page, with the tab of the hands open."""
    with open_page() as opened:
        opened.resize(1000, 700)
        opened.go_to(toy.url)
        opened.wait_for("window.vico && vico.source.connected && vico.state.before", seconds=90)
        opened.evaluate("vico.page.openTab('hands')")
        yield opened


def _click(page: BrowserPage, element: str) -> None:
    """Click an element where it is, as a person does."""
    x, y = page.evaluate(f"""(() => {{ const e = document.querySelector({json.dumps(element)});
      e.scrollIntoView({{ block: "center" }}); const box = e.getBoundingClientRect();
      return [box.left + box.width / 2, box.top + box.height / 2]; }})()""")
    page.click(x, y)


def _fill(page: BrowserPage, title: str, **values: object) -> None:
    """Fill in the form whose button has a title, and click that."""
    script = f"""(() => {{ const form = [...document.querySelectorAll("#hands form")].find((f) =>
        f.querySelector("button").textContent === {json.dumps(title)});
      for (const [name, value] of Object.entries({json.dumps(values)})) form.elements[name].value = value;
      document.querySelector("#hands [data-here]")?.removeAttribute("data-here");
      form.querySelector("button").setAttribute("data-here", ""); }})()"""
    page.evaluate(script)
    _click(page, "#hands [data-here]")
    page.wait_for(f"document.getElementById('toast').textContent.startsWith({json.dumps(title + ': done')})")


def _pause(page: BrowserPage, toy: LiveToy) -> int:
    if not page.evaluate("vico.source.run.control.paused"):
        _click(page, "#play")
    page.wait_for("vico.source.run.control.paused")
    page.wait_for(f"vico.source.last === {toy.sim.metrics.steps}")
    return toy.sim.metrics.steps


def test_the_button_holds_the_run_up_and_lets_it_go_on(live: BrowserPage, toy: LiveToy) -> None:
    live.evaluate("vico.clock.following = true")
    held = _pause(live, toy)
    live.evaluate("new Promise((done) => setTimeout(done, 700))")
    assert toy.sim.metrics.steps == held
    assert live.evaluate("document.getElementById('play').ariaLabel") == "Play"
    _click(live, "#play")
    live.wait_for(f"vico.source.last > {held}")


def test_a_step_is_one_step(live: BrowserPage, toy: LiveToy) -> None:
    held = _pause(live, toy)
    _click(live, "#forward")
    live.wait_for(f"vico.source.last === {held + 1}")
    live.evaluate("document.activeElement.blur(), document.getElementById('scene').focus()")
    live.press(".", "Period")
    live.wait_for(f"vico.source.last === {held + 2}")
    assert toy.sim.metrics.steps == held + 2


def test_the_speed_is_the_runs_own(live: BrowserPage, toy: LiveToy) -> None:
    live.evaluate("""(() => { const s = document.getElementById("speed"); s.value = "8";
      s.dispatchEvent(new Event("change")); })()""")
    live.wait_for("vico.source.run.control.speed === 8")
    assert toy.control.told()["speed"] == 8.0


def test_the_weather_becomes_what_was_chosen(live: BrowserPage, toy: LiveToy) -> None:
    held = _pause(live, toy)
    assert "snow" in weather_kinds()
    _fill(live, "Weather", kind="snow", over=1)
    for k in range(3):
        _click(live, "#forward")
        live.wait_for(f"vico.source.last === {held + 1 + k}")
    live.wait_for(f"vico.state.before.step >= {held + 2} && vico.state.before.sky[6] > 0")
    live.wait_for("/snow/.test(document.getElementById('weather').textContent)")
    assert [line.command for line in read_interventions(toy.control.out)] == ["weather"]


def test_a_bookmark_is_kept_listed_and_gone_back_to(live: BrowserPage, toy: LiveToy) -> None:
    held = _pause(live, toy)
    live.wait_for(f"vico.page.step === {held}")
    _fill(live, "Bookmark this step", text="here it snows")
    assert [mark["text"] for mark in toy.control.command("bookmarks", {}).result(20)["bookmarks"]] == ["here it snows"]
    _click(live, "#forward")
    live.wait_for(f"vico.page.step === {held + 1}")
    live.wait_for("document.querySelector('#hands li button')?.textContent.startsWith('here it snows')")
    _click(live, "#hands li button")
    live.wait_for(f"vico.page.step === {held}")
    live.wait_for("vico.page.timeline.bookmarks.length === 1")
    _click(live, "#live")
    live.wait_for(f"vico.page.step === {held + 1}")


def test_without_a_marked_spot_nothing_is_closed(live: BrowserPage) -> None:
    live.evaluate("""(() => { vico.page.spot = null; const form = [...document.querySelectorAll("#hands form")]
      .find((f) => /^Close the road/.test(f.querySelector("button").textContent));
      form.querySelector("button").click(); })()""")
    live.wait_for("/Mark a spot first/.test(document.getElementById('toast').textContent)")


def test_no_error_came_up(live: BrowserPage) -> None:
    assert live.faults == []
