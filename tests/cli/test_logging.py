"""One logger for the library, set once by the command line."""

import logging
import subprocess
import sys

import pytest

SPEAK = """
import logging
from vico.cli import main
main.app.cli = lambda **given: (logging.getLogger("vico.x").{0}("heard"), print(given["args"]))[0]
main.main({1!r})
"""


@pytest.mark.parametrize(
    ("level", "option", "heard"),
    [
        ("warning", [], True),
        ("info", [], False),
        ("info", ["--verbose"], True),
        ("warning", ["--quiet"], False),
        ("error", ["--quiet"], True),
    ],
)
def test_what_is_told_on_stderr_is_chosen_before_the_verb(level: str, option: list[str], heard: bool) -> None:
    code = SPEAK.format(level, [*option, "world"])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "['world']\n"
    assert done.stderr == ("vico: heard\n" if heard else "")


FAIL = """
from vico.cli import main
def fail(**given):
    raise {0}
main.app.cli = fail
main.main({1!r})
"""


@pytest.mark.parametrize("error", ["IndexError('list index out of range')", "OSError(5, 'Input/output error')"])
def test_a_fault_of_the_program_is_a_sentence_and_its_traceback_is_for_who_asks(error: str) -> None:
    said = {}
    for option in ([], ["--verbose"]):
        code = FAIL.format(error, [*option, "world"])
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
        assert done.returncode == 2
        said[bool(option)] = done.stderr
    (sentence,) = said[False].splitlines()
    assert sentence.startswith(f"vico: {error.split('(')[0]}: ")
    assert "a fault of vico; please report it" in sentence
    assert "Traceback" in said[True]
    assert sentence in said[True]


def test_modules_log_under_their_own_names() -> None:
    from vico.io import http

    assert http.log is logging.getLogger("vico.io.http")
