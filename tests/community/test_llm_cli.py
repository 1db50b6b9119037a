"""`vico community build --llm` as a newcomer types it: with a server, without, with a recording, with nothing named."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from command_line import vico
from http_server import serve
from scripted_author import ScriptedAuthor
from vico.community import read_community


@pytest.fixture(autouse=True)
def no_model(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("BASE_URL", "MODEL", "KEY", "PRICE", "RECORD", "REPLAY"):
        monkeypatch.delenv(f"VICO_LLM_{name}", raising=False)
    for name in ("OPENAI_BASE_URL", "OPENAI_API_KEY"):
        monkeypatch.delenv(name, raising=False)


def named(monkeypatch: pytest.MonkeyPatch, base: str) -> None:
    monkeypatch.setenv("VICO_LLM_BASE_URL", f"{base}/v1")
    monkeypatch.setenv("VICO_LLM_MODEL", "scripted")


def test_a_model_writes_and_a_recording_gives_the_same_bytes(
    corner_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    build = ["community", "build", corner_path, "--residents", 4]
    with serve(ScriptedAuthor()) as base:
        named(monkeypatch, base)
        calls = ["--llm-cache", tmp_path / "cache", "--llm-record", tmp_path / "calls.jsonl"]
        assert vico(*build, "--llm", *calls, "--out", tmp_path / "people", "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["author"] == "scripted"
    assert told["llm"]["fallen_back"] == []
    assert told["llm"]["calls"] > 4
    assert vico("check", "community", tmp_path / "people", "--world", corner_path) == 0
    monkeypatch.delenv("VICO_LLM_BASE_URL")
    assert vico(*build, "--llm-replay", tmp_path / "calls.jsonl", "--out", tmp_path / "again") == 0
    assert "Written by scripted" in capsys.readouterr().out
    for name in ("community.json", "residents.json", "groups.json", "relations.json", "authorship.json"):
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "people" / name).read_bytes()


def test_a_budget_of_nothing_ends_well_and_says_so(
    corner_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    named(monkeypatch, "http://127.0.0.1:9")
    build = ["community", "build", corner_path, "--residents", 4, "--llm", "--llm-cache", tmp_path / "cache"]
    assert vico(*build, "--llm-budget-tokens", 0, "--out", tmp_path / "people") == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "By rule, as the model did not write them so that they hold: everything" in said
    assert "0 of 0 tokens are spent" in said
    community = read_community(tmp_path / "people")
    assert community.author == "procedural"
    assert community.authorship is not None
    assert vico(*build, "--llm-only", "--llm-budget-tokens", 0, "--out", tmp_path / "strict") == 2
    error = capsys.readouterr().err
    assert "leave --llm-only out" in error
    assert not (tmp_path / "strict").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--llm"], "no language model is named: set VICO_LLM_BASE_URL"),
        (["--llm-budget-tokens", 5], "--llm-budget-tokens is for a language model: add --llm"),
        (["--llm-replay", "nowhere.jsonl"], "nowhere.jsonl: no such recording"),
    ],
)
def test_what_is_missing_is_one_sentence(
    corner_path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], arguments: list[object], words: str
) -> None:
    assert vico("community", "build", corner_path, *arguments, "--out", tmp_path / "people") == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1
    assert not (tmp_path / "people").exists()


def test_a_model_that_is_not_named_and_prices_that_are_not_known_are_said(
    corner_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VICO_LLM_BASE_URL", "http://127.0.0.1:9/v1")
    build = ["community", "build", corner_path, "--llm", "--out", tmp_path / "people"]
    assert vico(*build) == 2
    assert "VICO_LLM_MODEL: name the model" in capsys.readouterr().err
    monkeypatch.setenv("VICO_LLM_MODEL", "scripted")
    assert vico(*build, "--llm-budget-cost", 1) == 2
    assert "set VICO_LLM_PRICE" in capsys.readouterr().err
