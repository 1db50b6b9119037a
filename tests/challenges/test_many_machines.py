"""Evaluations on a Ray cluster and in an object store: whatever dies, nothing is lost and the table is the same."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from ray_nodes import RayNodes, needs_ray
from s3_server import S3Server, needs_s3
from toy_challenge import NAME, TOY, played, toy_world
from toy_challenge import toy_jobs as jobs
from vico.challenges import evaluation
from vico.challenges.evaluation import evaluate
from vico.challenges.tables.results import write_results
from vico.errors import InputError
from vico.io.stores import Store, store_at


@pytest.fixture
def worlds(tmp_path: Path) -> list[Path]:
    return [toy_world(tmp_path / "worlds" / name) for name in ("east", "west")]


@pytest.fixture
def bucket() -> Iterator[str]:
    with S3Server() as server:
        yield server.bucket("results")


def table(worlds: list[Path], where: Path | Store, out: Path, *, ray: str | None = None, **setting: Any) -> list[bytes]:
    """Play the toy's jobs, and return the bytes of the results."""
    outcomes = evaluate(NAME, jobs(worlds, seeds=4, **setting), where, workers=2 if ray else 1, ray=ray)
    out.mkdir(parents=True, exist_ok=True)
    write_results(out, TOY, outcomes)
    return [(out / name).read_bytes() for name in ("results.json", "results.md")]


@needs_ray
def test_a_cluster_comes_to_the_same_table_byte_for_byte(worlds: list[Path], tmp_path: Path) -> None:
    alone = table(worlds, tmp_path / "alone", tmp_path / "alone")
    assert table(worlds, tmp_path / "ray", tmp_path / "ray", ray="local") == alone
    names = [sorted(p.name for p in (tmp_path / run / "episodes").iterdir()) for run in ("alone", "ray")]
    assert names[0] == names[1]
    assert len(names[0]) == 32
    assert not list((tmp_path / "ray").glob(".*"))


@needs_s3
def test_an_object_store_holds_an_evaluation_and_it_goes_on_there(
    worlds: list[Path], bucket: str, tmp_path: Path
) -> None:
    count = tmp_path / "count"
    setting = {"count_in": str(count)}
    store = store_at(f"{bucket}/toy")
    first = evaluate(NAME, jobs(worlds, seeds=4, **setting)[:7], store)
    assert all(outcome.record is not None for outcome in first)
    assert len(store.names("episodes")) == 7
    alone = table(worlds, tmp_path / "alone", tmp_path / "alone", **setting)
    before = len(played(count))
    assert table(worlds, store, tmp_path / "stored", **setting) == alone
    assert len(played(count)) == before + 32 - 7
    assert len(store.names("episodes")) == 32
    assert len(store.names("tasks")) == 16


@needs_s3
def test_a_damaged_episode_in_a_store_is_played_again(worlds: list[Path], bucket: str) -> None:
    store = store_at(f"{bucket}/toy")
    asked = jobs(worlds[:1], methods=("good",), seeds=2)
    whole = evaluate(NAME, asked, store, record=True)
    assert len(store.names("runs")) == len(asked) == 4
    first, second, *_ = store.names("episodes")
    store.write(f"episodes/{first}", b"{" * 5000)
    store.write(f"episodes/{second}", b"[]")
    again = evaluate(NAME, asked, store, record=True)
    assert sum(not outcome.kept for outcome in again) == 2
    assert [outcome.record for outcome in again] == [outcome.record for outcome in whole]


@needs_ray
@needs_s3
def test_a_cluster_plays_into_an_object_store(worlds: list[Path], bucket: str, tmp_path: Path) -> None:
    store = store_at(f"{bucket}/toy")
    alone = table(worlds, tmp_path / "alone", tmp_path / "alone")
    assert table(worlds, store, tmp_path / "ray", ray="local") == alone
    assert len(store.names("episodes")) == 32
    assert not store.names("") or all("seen" not in name for name in store.names(""))


def test_a_machine_that_sees_another_folder_or_has_other_code_is_refused(tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "challenge": NAME, "store": str(tmp_path), "code": "other", "record": False, "seen": ".seen-head-1",
    }  # fmt: skip
    with pytest.raises(InputError, match="not the same folder on every machine; give an --out that all of them share"):
        evaluation.player(options, lambda _: None)
    (tmp_path / ".seen-head-1").touch()
    with pytest.raises(InputError, match="other code"):
        evaluation.player(options, lambda _: None)


# What dies, while it runs on three nodes of this machine:


@pytest.fixture(scope="module")
def nodes() -> Iterator[RayNodes]:
    with RayNodes(3) as cluster:
        yield cluster


def program(worlds: list[Path], out: Path, address: str, **setting: Any) -> str:
    return (
        "from pathlib import Path; import test_many_machines as t\n"
        f"t.table([Path(p) for p in {[str(w) for w in worlds]!r}], Path({str(out)!r}), Path({str(out)!r}), "
        f"ray={address!r}, **{setting!r})\n"
    )


def wait_for(episodes: int, out: Path, process: subprocess.Popen[str]) -> None:
    began = time.monotonic()
    while len(list((out / "episodes").glob("*.json"))) < episodes:
        assert process.poll() is None
        assert time.monotonic() - began < 180
        time.sleep(0.05)


@pytest.mark.slow
@needs_ray
@pytest.mark.parametrize("what", ["a worker", "a node", "the driver"])
def test_whatever_is_killed_nothing_is_lost_and_the_table_is_equal(
    what: str, nodes: RayNodes, worlds: list[Path], tmp_path: Path
) -> None:
    out, count = tmp_path / "out", tmp_path / "count"
    setting = {"slow": 0.5, "count_in": str(count)}

    def start() -> subprocess.Popen[str]:
        return nodes.driver(program(worlds, out, nodes.address, **setting))

    process = start()
    wait_for(6, out, process)
    if what == "a worker":
        worker_at_work = int(count.read_text().split()[-1])
        subprocess.run(["kill", "-9", str(worker_at_work)], check=False)
    elif what == "a node":
        nodes.kill(2)
        nodes.add()
    else:
        process.send_signal(signal.SIGKILL)
        process.wait()
        time.sleep(3.0)  # Ray ends what it was at
        before = len(played(count))
        assert before < 32
        process = start()
    assert process.wait(180) == 0
    there = [(out / name).read_bytes() for name in ("results.json", "results.md")]
    assert there == table(worlds, tmp_path / "alone", tmp_path / "alone", **setting)
    # What was under way is all that was played twice: three nodes had a task each.
    assert 32 <= len(played(count)) - 32 <= 32 + 3
