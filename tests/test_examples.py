"""The examples run as they are printed in the documentation."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from command_line import script
from vico.community import build_community, write_community
from vico.io.files import read_json
from vico.world.world import World

EXAMPLES = Path(__file__).parents[1] / "examples"


def run(name: str, *arguments: str) -> str:
    """Run an example in this process: one of its own costs seconds of imports."""
    done = script(EXAMPLES / name, *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def run_alone(name: str, *arguments: str) -> str:
    """Run one in a process of its own, as those need that start others; the first, too."""
    done = subprocess.run(
        [sys.executable, str(EXAMPLES / name), *arguments], capture_output=True, text=True, timeout=400, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_first_world_builds_and_is_seen(tmp_path: Path) -> None:
    printed = run_alone("01_first_world.py", "--out", str(tmp_path / "w"), "--radius", "100")
    assert "buildings" in printed
    assert (tmp_path / "w.png").stat().st_size > 20_000


def test_first_agent_walks(helsinki_path: Path) -> None:
    printed = run("02_first_agent.py", "--world", str(helsinki_path), "--steps", "30")
    metres = float(printed.split("walked ")[1].split(" m")[0])
    assert metres >= 8


def test_delivery_gives_a_verdict_for_each_errand(helsinki_path: Path) -> None:
    printed = run("03_delivery.py", "--world", str(helsinki_path), "--steps", "60")
    assert printed.count("done") == 6


def test_a_parcel_goes_with_the_robot(helsinki_path: Path) -> None:
    printed = run("04_robots.py", "--world", str(helsinki_path), "--steps", "25")
    metres = float(printed.split("the parcel went ")[1].split(" m")[0])
    assert metres >= 5


def test_an_agent_keeps_the_contract_alone_in_its_process(helsinki_path: Path) -> None:
    printed = run_alone("05_agent_contract.py", "--world", str(helsinki_path), "--steps", "20")
    assert "findings: []" in printed
    assert "went on from the middle to the same end: True; faults: {}" in printed


def test_environments_side_by_side_branches_and_periods(helsinki_path: Path, helsinki_people: Path) -> None:
    printed = run_alone("06_many_environments.py", "--world", str(helsinki_path), "--community", str(helsinki_people))
    assert "2 environments: poses of shape (2, 6)" in printed
    assert "time is still 28800 s" in printed
    assert "50 observations of the robot and 1 of the assistant" in printed


def test_a_policy_is_trained_a_little(helsinki_path: Path, tmp_path: Path) -> None:
    pytest.importorskip("stable_baselines3", reason='needs pip install "virtual-community[rl]"')
    curve = tmp_path / "curve.csv"
    words = ("--steps", "1024", "--episodes", "2", "--curve", str(curve))
    printed = run_alone("14_train_with_sb3.py", "--world", str(helsinki_path), *words)
    assert re.search(r"\ntrained: success [01]\.\d\d\n", printed)
    assert curve.read_text().splitlines()[1].startswith("1024,")


def test_getting_around_prints_trips_and_arrives(helsinki_path: Path) -> None:
    printed = run("07_getting_around.py", "--world", str(helsinki_path), "--steps", "600")
    assert "on foot: walk" in printed
    assert " after " in printed


def test_an_agent_is_written_scored_and_ranked(helsinki_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    printed = run_alone("11_write_an_agent.py", "--worlds", str(helsinki_path), "--out", str(out), "--steps", "15")
    assert "findings: []" in printed
    assert printed.count(" of 6 found; why not: {") == 2
    assert {entry["method"].rpartition(":")[2] for entry in read_json(out / "leaderboard.json")["entries"]} == {
        "Looker", "random",
    }  # fmt: skip


def test_the_agent_of_the_page_is_the_one_that_runs() -> None:
    page = (EXAMPLES.parent / "docs" / "write_an_agent.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    example = (EXAMPLES / "11_write_an_agent.py").read_text(encoding="utf-8")
    assert code.removeprefix("import math\n").strip() in example


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.py")), ids=lambda path: path.name)
def test_each_example_says_how_it_is_run(path: Path) -> None:
    assert f"python examples/{path.name} " in path.read_text()


def test_events_close_a_street_and_cut_the_power(helsinki_path: Path) -> None:
    printed = run("08_events.py", "--world", str(helsinki_path), "--street", "Mikonkatu", "--steps", "60")
    assert "known (announced): new pipes" in printed
    assert "2 barriers stand" in printed
    assert "0 of 15 cars on Mikonkatu, 0 vanished" in printed


def test_a_function_stands_in_for_a_language_model(corner_path: Path) -> None:
    printed = run("13_llm_author.py", "--world", str(corner_path), "--residents", "3")
    assert printed.count("can tell the time by shadows") == 3
    assert "character {'written by the model': 3}" in printed
    assert "schedule {'no usable reply': 3}" in printed


@pytest.mark.slow
def test_a_scene_of_the_film_is_filmed(helsinki_path: Path, tmp_path: Path) -> None:
    small = ("--residents", "20", "--size", "128x72", "--samples", "1", "--scenes", "street")
    printed = run_alone("10_film.py", "--world", str(helsinki_path), "--out", str(tmp_path / "film"), *small)
    assert "walks to work, from step" in printed
    assert printed.endswith("film.mp4: 17 s\n")


@pytest.mark.parametrize("residents", [2, 30])
def test_people_are_asked_and_answer(residents: int, helsinki: World, helsinki_path: Path, tmp_path: Path) -> None:
    write_community(build_community(helsinki, residents=residents), tmp_path / "people", world=helsinki_path)
    printed = run(
        "12_asking_people.py", "--world", str(helsinki_path), "--community", str(tmp_path / "people"), "--steps", "60"
    )
    assert "assistant: Excuse me, have you seen" in printed
    assert "   understood: " in printed


def test_in_a_community_of_one_nobody_can_be_asked(helsinki: World, helsinki_path: Path, tmp_path: Path) -> None:
    write_community(build_community(helsinki, residents=1), tmp_path / "people", world=helsinki_path)
    where = ("--world", str(helsinki_path), "--community", str(tmp_path / "people"))
    done = script(EXAMPLES / "12_asking_people.py", *where)
    assert done.returncode == 2
    assert done.stderr == ("asking: nobody in this community walks by who knows somebody indoors: make a larger one\n")


def test_an_arm_is_scored_on_lifting_a_box() -> None:
    printed = run("18_manipulation.py", "--task", "lift", "--episodes", "3")
    assert "vico/Lift-v0: observations (42,), actions (8,)" in printed
    assert "random: success 0.00 at the end" in printed
    assert "expert: success 1.00 at the end" in printed


def test_a_learned_arm_is_a_method_of_the_challenge(helsinki_path: Path) -> None:
    printed = run("20_learned_arm.py", "--world", str(helsinki_path), "--seconds", "3")
    assert "actions (11,)" in printed
    assert "random actions: reward -" in printed
    assert "rl: SR 0, not found, 3 s" in printed


def test_work_of_ones_own_is_shared_out(helsinki_path: Path) -> None:
    printed = [run_alone("17_many_machines.py", str(helsinki_path), "nowhere", "--workers", n) for n in ("1", "2")]
    assert sorted(printed[0].splitlines()) == sorted(printed[1].splitlines())
    assert re.search(r"^\w+: \d+ buildings, \d+\.\d\d ha to walk on$", printed[0], re.MULTILINE)
    assert "nowhere: nowhere: no such folder" in printed[0]


def test_a_program_watches_a_run_and_reaches_into_it(
    helsinki_path: Path, helsinki_people: Path, tmp_path: Path
) -> None:
    pytest.importorskip("uvicorn", reason="needs pip install 'virtual-community[viewer]'")
    where = ("--world", str(helsinki_path), "--community", str(helsinki_people), "--out", str(tmp_path / "live"))
    printed = run_alone("15_live.py", *where)
    assert "4 residents; the run is paused" in printed
    assert printed.count("step 5: ") == 4
    assert "step 10: 4.0 mm of rain an hour\nwhat if it stayed dry, in live.from-5\nstep 10: 0.0 mm" in printed
    assert {path.name for path in tmp_path.iterdir()} == {"live", "live.from-5"}


def test_what_was_shown_is_done_again(tmp_path: Path) -> None:
    printed = run_alone("19_imitation.py", "--out", str(tmp_path / "demos"), "--episodes", "1")
    assert "frames: Pick up the blue shoe box and put it down next to the pink thermos flask." in printed
    assert "seed 7 done again: done" in printed


def test_a_roof_of_a_city_model_is_built_where_the_map_has_the_house(tmp_path: Path) -> None:
    printed = run("21_real_roofs.py", "--out", str(tmp_path / "w"))
    assert "1 from cityjson:w.city.json surfaces" in printed
    assert "hipped, 26.0 m to the ridge" in printed
