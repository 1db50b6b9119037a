"""A real small model on this machine: what it writes is poor; that it comes as a record, from a server, is tested."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict

from toytown import make_world
from vico.assets.packages import SMALL_LANGUAGE_MODEL, installed_folder, small_language_model
from vico.community import build_community, check_community
from vico.community.llm import LlmCommunityAuthor
from vico.errors import InputError, MissingExtraError, MissingFileError
from vico.llm import Budget, Connection, Endpoint, LanguageModel, Sampling, user
from vico.llm.local import serve_model

HAS_SERVER = importlib.util.find_spec("xllamacpp") is not None
HAS_MODEL = installed_folder(SMALL_LANGUAGE_MODEL) is not None

needs_server = pytest.mark.skipif(not HAS_SERVER, reason="no xllamacpp: pip install 'virtual-community[llm]'")
needs_model = pytest.mark.skipif(not HAS_MODEL, reason="no small model: vico assets install llm")


class Fruit(BaseModel):
    """What the model is asked for."""

    model_config = ConfigDict(extra="forbid")

    fruit: str
    sweet: bool


def test_a_missing_server_is_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "xllamacpp", None)
    with pytest.raises(MissingExtraError, match=r"virtual-community\[llm\]"), serve_model(tmp_path / "m.gguf"):
        pass


def test_a_missing_model_is_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("VICO_CACHE", str(tmp_path))
    with pytest.raises(MissingExtraError, match="vico assets install llm"):
        small_language_model()


@needs_server
def test_a_file_that_is_no_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no weights"), serve_model(tmp_path / "none.gguf"):
        pass
    (tmp_path / "text.gguf").write_text("no model")
    with pytest.raises(InputError, match="no GGUF file"), serve_model(tmp_path / "text.gguf"):
        pass
    with pytest.raises(InputError, match="threads 0"), serve_model(tmp_path / "text.gguf", threads=0):
        pass


@pytest.mark.slow
@needs_server
@needs_model
def test_a_real_model_keeps_to_a_schema() -> None:
    with serve_model(small_language_model(), context=1024) as base:
        assert base.startswith("http://127.0.0.1:")
        model = LanguageModel(Endpoint(base, "small"), sampling=Sampling(seed=0, temperature=0.0, max_tokens=60))
        reply = model.ask([user("Name a fruit, and say whether it is sweet.")], Fruit)
    assert reply.value.fruit
    assert reply.usage.read > 10


@pytest.mark.slow
@needs_server
@needs_model
def test_a_real_model_ends_no_build() -> None:
    town = make_world()
    with serve_model(small_language_model()) as base:
        model = LanguageModel(
            Endpoint(base, "small"), budget=Budget(calls=8), connection=Connection(timeout=600.0, retries=0),
            sampling=Sampling(seed=0, max_tokens=1500),
        )  # fmt: skip
        author = LlmCommunityAuthor(model, workers=1, rounds=1)
        made = build_community(town, residents=2, seed=0, author=author)
    assert check_community(made, town) == []
    assert 1 <= model.budget.spent.calls <= 8
    assert author.report is not None
    assert author.report.authorship == made.authorship
