"""A helper does tasks in another process while this one goes on, and says what went wrong."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from vico.errors import OutputError
from vico.jobs import Helper, Service

DOUBLER = Service("toy_service:doubler")


def test_tasks_are_done_in_another_process_and_one_that_fails_ends_no_other() -> None:
    with Helper(DOUBLER) as helper:
        numbers = [helper.ask({"n": 1}), helper.ask({"n": 2, "bug": True}), helper.ask({"n": 3})]
        last, first, bad = (helper.answer(numbers[k]) for k in (2, 0, 1))
    assert first.content is not None
    assert last.content is not None
    assert (first.content["twice"], last.content["twice"]) == (2, 6)
    assert first.content["process"] == last.content["process"] != os.getpid()
    assert bad.reason.startswith("KeyError: 'no such number' at toy_service.py")


def test_a_task_is_taken_back_unless_it_was_begun(tmp_path: Path) -> None:
    begun, go_on = tmp_path / "begun", tmp_path / "go on"
    with Helper(Service("toy_service:waiter")) as helper:
        first, second = helper.ask({"begun": str(begun), "until": str(go_on)}), helper.ask({"begun": "never"})
        while not begun.exists():
            time.sleep(0.01)
        assert helper.withdraw(second)
        assert not helper.withdraw(first)
        go_on.touch()
        assert helper.answer(first).content == {}
        third = helper.ask({"begun": str(begun), "until": str(go_on)})
        helper.answer(helper.ask({"begun": str(begun), "until": str(go_on)}))
        assert not helper.withdraw(third)


def test_a_service_that_cannot_be_made_answers_every_task_with_the_reason() -> None:
    with Helper(Service("toy_service:doubler", {"refuse": True})) as helper:
        answers = [helper.answer(helper.ask({"n": n})) for n in range(2)]
    assert [answer.reason for answer in answers] == ["no doubling today"] * 2


def test_a_process_that_dies_answers_what_it_was_asked(tmp_path: Path) -> None:
    with Helper(DOUBLER) as helper:
        numbers = [helper.ask({"n": 1, "always": True}), helper.ask({"n": 2})]
        assert [helper.answer(number).reason for number in numbers] == ["its process ended with exit status -9"] * 2
        assert helper.withdraw(helper.ask({"n": 3}))


def test_a_full_disk_is_told() -> None:
    with Helper(DOUBLER) as helper, pytest.raises(OutputError, match="the disk is full"):
        helper.answer(helper.ask({"n": 0, "full": True}))


def test_a_script_needs_no_guard_and_what_the_service_prints_is_no_answer(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "from vico.jobs import Helper, Service\n"
        "with Helper(Service('toy_service:waiter')) as helper:\n"
        f"    print(helper.answer(helper.ask({{'begun': {str(tmp_path / 'begun')!r}, 'until': {str(script)!r}}})))\n"
    )
    path = os.pathsep.join(sys.path)
    child = subprocess.run(
        [sys.executable, str(script)], env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=60
    )
    assert child.stdout == "Answer(content={}, reason='')\n"
    assert "begun" in child.stderr


def test_it_ends_with_whoever_started_it(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    script = (
        "import os; from vico.jobs import Helper, Service\n"
        "helper = Helper(Service('toy_service:waiter'))\n"
        f"helper.ask({{'begun': {str(begun)!r}, 'until': '/never'}})\n"
        f"while not os.path.exists({str(begun)!r}) or not os.path.getsize({str(begun)!r}): pass\n"
        "os.kill(os.getpid(), 9)\n"
    )
    path = os.pathsep.join(sys.path)
    subprocess.run([sys.executable, "-c", script], env=os.environ | {"PYTHONPATH": path}, timeout=60)
    process = int(begun.read_text())
    for _ in range(500):
        if not _runs(process):
            return
        time.sleep(0.02)
    pytest.fail("it goes on")


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    about = Path(f"/proc/{process}/stat")  # one that ended and nobody has asked about is a zombie
    return not (about.exists() and about.read_text().rpartition(")")[2].split()[0] == "Z")
