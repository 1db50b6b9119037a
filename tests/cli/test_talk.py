"""`vico run --talk llm`: residents' answers, worded by a server that a test has written the words of."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import toy_city
from command_line import vico
from llm_server import model_server, refuses
from vico.cli import run as verb
from vico.sim.recording import read_run

SAID = "I am well, and about to have some soup."


@pytest.fixture(autouse=True)
def _toy(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let the toy city stand for any folders, and name no model."""
    monkeypatch.setattr(verb, "read_world", lambda path: toy_city.world())
    monkeypatch.setattr(verb, "read_community", lambda path, world: toy_city.community())
    monkeypatch.setattr(verb, "read_names", lambda path: {one.id: one.name for one in toy_city.community().residents})
    for name in ("VICO_LLM_BASE_URL", "VICO_LLM_MODEL", "VICO_LLM_KEY", "OPENAI_BASE_URL", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)


def answered(out: Path, *more: object) -> tuple[int, list[str]]:
    """Run some seconds in which Ada asks Bo, beside her in the café; return the exit code and what Bo says."""
    code = vico(
        "run", "toy", "people", "--start", "07:59:40", "--steps", 2, "--robots", "none", "--cars", 0,
        "--pedestrians", 0, "--observe", "none", "--out", out, *more,
    )  # fmt: skip
    messages = [event for event in read_run(out).events if event["kind"] == "message"]
    assert [one["text"][:23] for one in messages if one["agent"] == "resident_0"] == ["Good morning, Bo! I'm g"]
    return code, [one["text"] for one in messages if one["agent"] == "resident_1"]


def test_a_model_words_the_answers(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with model_server(json.dumps({"text": SAID})) as (base, script):
        monkeypatch.setenv("VICO_LLM_BASE_URL", base)
        monkeypatch.setenv("VICO_LLM_MODEL", "test")
        assert answered(tmp_path / "run", "--talk", "llm") == (0, [SAID])
    assert len(script.asked) == 1
    assert "Good morning, Bo!" in script.last_words(0)
    assert "1 answers of residents by the language model, 120 tokens; 0 left to templates" in capsys.readouterr().err
    assert read_run(tmp_path / "run").manifest["command"]["talk"] == "llm"


def test_templates_answer_where_it_fails_and_without_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, (template,) = answered(tmp_path / "templates")
    assert (code, template == SAID) == (0, False)
    assert "language model" not in capsys.readouterr().err
    with model_server(refuses(401, "no such key")) as (base, _):
        monkeypatch.setenv("VICO_LLM_BASE_URL", base)
        monkeypatch.setenv("VICO_LLM_MODEL", "test")
        assert answered(tmp_path / "run", "--talk", "llm") == (0, [template])
    told = capsys.readouterr().err
    assert "0 answers of residents by the language model, 0 tokens; 1 left to templates (language model " in told


def test_without_an_endpoint_nothing_is_begun(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert vico("run", "toy", "people", "--talk", "llm", "--out", tmp_path / "run") == 2
    told = capsys.readouterr().err
    assert "run: --talk llm: no language model is named: set VICO_LLM_BASE_URL" in told
    assert "or leave --talk out" in told
    assert "Traceback" not in told
    assert not (tmp_path / "run").exists()
