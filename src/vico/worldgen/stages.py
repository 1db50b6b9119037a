"""The stages of a build: run, timed, reported, and kept, so that a killed build resumes and one stage runs alone.

A stage is a function of typed inputs. What it made is kept in a file of its own together with a key: a digest of the
stage's name, of this package's code, and of all inputs. A later build whose stage has the same key reads the file
instead of computing. So a build that was killed goes on where it stopped, a build with one other option computes only
what depends on it, and a stage that is run again by name passes on nothing new unless its result is another.
"""

from __future__ import annotations

import logging
import os
import time
import weakref
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from vico.errors import MissingFileError, SchemaError, StageError, VicoError, line_of, sentence_of
from vico.geo.overlay import OverlayError
from vico.io.data_files import VARIABLE
from vico.version import __version__
from vico.world.model import TRIED, Dropped, StageReport
from vico.worldgen.facts.fault_isolation import Losses, collect_losses
from vico.worldgen.product import digest_of, read_head, read_product, write_product

Progress = Callable[[str, int, int], None]
T = TypeVar("T")

_log = logging.getLogger(__name__)
_CODE = ("*.py", *(f"{room}/**/*.py" for room in ("io", "geo", "world", "assets", "render", "worldgen", "llm")))
_DATA = ("data/**/*.toml",)
SUFFIX = ".stage"


@dataclass(frozen=True)
class _Kept:
    """What the file of a stage holds: what it made, what it left out, and of how many objects (0 if nothing)."""

    value: Any
    dropped: list[Dropped]
    tried: int


def code_digest() -> str:
    """Return the SHA-256 of the code and data that build worlds: another version may make others of the same inputs."""
    return _code_digest(os.environ.get(VARIABLE, ""))


@cache
def _code_digest(own_data: str) -> str:
    root = Path(__file__).parents[1]
    total = sha256(__version__.encode())
    for pattern in (*_CODE, *_DATA):
        for path in sorted(root.glob(pattern)):
            total.update(path.relative_to(root).as_posix().encode())
            total.update(path.read_bytes())
    for path in sorted(Path(own_data).rglob("*.toml")) if own_data else []:
        total.update(path.relative_to(own_data).as_posix().encode())
        total.update(path.read_bytes())
    return total.hexdigest()


class Stages:
    """Runs stages and keeps what they made.

    Parameters
    ----------
    folder
        Where products are kept; None keeps nothing.
    again
        Names of stages to run even if their product is there.
    progress
        Called with a stage's name, how much of it is done, and how much there is.
    beside
        Another folder of products, which is read and never written.

    Attributes
    ----------
    seconds
        Wall seconds a stage took, by name.
    reports
        What the stages made and left out.
    kept
        Names of stages whose product was read instead of computed.
    lost
        Ids of all objects that stages left out while they made them (see `expendable`).
    """

    def __init__(
        self,
        folder: Path | None,
        *,
        again: Collection[str] = (),
        progress: Progress | None = None,
        beside: Path | None = None,
    ) -> None:
        self.seconds: dict[str, float] = {}
        self.reports: list[StageReport] = []
        self.kept: list[str] = []
        self.lost: set[str] = set()
        self._folder = folder
        self._again = set(again)
        self._progress = progress
        self._beside = beside
        self._elsewhere: dict[str, Callable[[], float | None]] = {}
        self._digests: dict[int, tuple[Callable[[], Any], str]] = {}

    def given(self, value: T, digest: str) -> T:
        """Make an input known by a digest of its own (of the file it was read from), and return it."""
        try:
            # Known as long as somebody holds it: the meshes and photos of a district would fill gigabytes.
            self._digests[id(value)] = weakref.ref(value), digest
        except TypeError:
            if not isinstance(value, tuple):  # tuples are taken apart: none is the input of a stage
                self._digests[id(value)] = lambda: value, digest
        return value

    def digested(self, value: T) -> T:
        """Take the digest of a value that is the input of several stages, once, and return the value."""
        return self.given(value, digest_of(value))

    def digest(self, value: Any) -> str:
        """Return the digest of an input: as it is known by, else of its content."""
        known = self._digests.get(id(value))
        return known[1] if known is not None and known[0]() is value else digest_of(value)

    def run(self, name: str, function: Callable[..., T], *inputs: Any, **options: Any) -> T:
        """Run a stage, or read what it made from the same inputs before.

        `inputs` and `options` are passed to `function`; both count towards the key. A callable among the options
        does not: it says how, not what (a progress callback, a picture taker).

        Raises
        ------
        StageError
            If it fails as a whole, for no object in particular.
        """
        self._tell(name, 0)
        elsewhere = self._elsewhere.pop(name, lambda: None)()
        start = time.perf_counter()
        value = self._product(name, function, inputs, options, made=elsewhere is not None)
        seconds = (elsewhere or 0.0) + time.perf_counter() - start
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        self._tell(name, 1)
        return value

    def await_first(self, name: str, made: Callable[[], float | None]) -> None:
        """Say that a stage is being made elsewhere, and kept with the same key; `run` waits for that first.

        Parameters
        ----------
        name
            Of the stage.
        made
            Waits for it, and returns the seconds that it took; None if it was not made.
        """
        self._elsewhere[name] = made

    @contextmanager
    def timed(self, name: str) -> Iterator[None]:
        """Time a step that keeps no product: reading the sources, writing files, taking pictures."""
        self._tell(name, 0)
        start = time.perf_counter()
        with _as_a_whole(name) as losses:
            yield
        self._report_losses(name, losses.dropped, len(losses.tried))
        self.seconds[name] = time.perf_counter() - start
        self._tell(name, 1)

    def report(self, name: str, counts: dict[str, int], dropped: Iterable[Dropped] = ()) -> None:
        """Record what a stage made and left out, beside what is recorded of it already."""
        for k, report in enumerate(self.reports):
            if report.name == name:
                both = {**report.counts, **counts}
                self.reports[k] = StageReport(name=name, counts=both, dropped=[*report.dropped, *dropped])
                return
        self.reports.append(StageReport(name=name, counts=counts, dropped=list(dropped)))

    def counts(self, name: str) -> dict[str, int]:
        """Return how much of what a stage reported."""
        counts = next(report.counts for report in self.reports if report.name == name)
        return {what: number for what, number in counts.items() if what != TRIED}

    def sweep(self) -> None:
        """Remove products of stages that this build did not have."""
        if self._folder is not None and self._folder.is_dir():
            for path in self._folder.glob(f"*{SUFFIX}"):
                if path.name.removesuffix(SUFFIX) not in self.seconds:
                    path.unlink()

    def _tell(self, name: str, done: int) -> None:
        if self._progress is not None:
            self._progress(name, done, 1)

    def _report_losses(self, name: str, dropped: list[Dropped], tried: int) -> None:
        """Record what a stage left out, if anything, and of how many objects."""
        if dropped:
            self.lost.update(one.id for one in dropped)
            self.report(name, {TRIED: tried}, dropped)

    def _product(
        self, name: str, function: Callable[..., T], inputs: tuple[Any, ...], options: dict[str, Any], *, made: bool
    ) -> T:
        if self._folder is None:
            with _as_a_whole(name) as losses:
                value = function(*inputs, **options)
            self._report_losses(name, losses.dropped, len(losses.tried))
            return value
        what = {key: self.digest(value) for key, value in sorted(options.items()) if not callable(value)}
        parts = [
            name,
            code_digest(),
            *(self.digest(value) for value in inputs),
            *(f"{k}={v}" for k, v in what.items()),
        ]
        key = sha256("\n".join(parts).encode()).hexdigest()
        path = self._folder / f"{name}{SUFFIX}"
        others = [] if self._beside is None else [self._beside / f"{name}{SUFFIX}"]
        for there in (path, *others) if made or name not in self._again else ():
            known = self._read(there, key) if there.exists() else None
            if known is not None:
                if not made:
                    self.kept.append(name)
                self._report_losses(name, known[0].dropped, known[0].tried)
                return self.given(known[0].value, known[1])
        with _as_a_whole(name) as losses:
            value = function(*inputs, **options)
        product = _Kept(value, losses.dropped, len(losses.tried) if losses.dropped else 0)
        self._report_losses(name, product.dropped, product.tried)
        return self.given(value, write_product(path, product, key=key))

    def _read(self, path: Path, key: str) -> tuple[_Kept, str] | None:
        """Read the product, if it was made under this key and is whole: a torn one is simply made anew."""
        try:
            made, digest = read_product(path) if read_head(path)[0] == key else (None, "")
        except SchemaError:
            os.unlink(path)
            return None
        return (made, digest) if isinstance(made, _Kept) else None


def keep_product(folder: Path, name: str, value: Any) -> str:
    """Keep something as what a stage made, for `kept_product` in another build; return its digest."""
    folder.mkdir(parents=True, exist_ok=True)
    return write_product(folder / f"{name}{SUFFIX}", _Kept(value, [], 0), key="")


def kept_product(folder: Path, name: str) -> tuple[Any, str]:
    """Return what a stage made in another build, and its digest.

    Raises
    ------
    MissingFileError, SchemaError
        If it is not there, or torn.
    """
    path = folder / f"{name}{SUFFIX}"
    if not path.exists():
        raise MissingFileError(f"{path}: no such file; plan the tiles of the city anew")
    made, digest = read_product(path)
    if not isinstance(made, _Kept):
        raise SchemaError(f"{path}: is no product of a stage; plan the tiles of the city anew")
    return made.value, digest


@contextmanager
def _as_a_whole(name: str) -> Iterator[Losses]:
    """Listen to a stage; what fails in it, for no object in particular, ends the build in a sentence."""
    try:
        with collect_losses() as losses:
            yield losses
    except OverlayError as error:
        _log.info("stage %s failed", name, exc_info=True)
        raise StageError(_failed(name, error)) from error
    except (VicoError, OSError, MemoryError):
        raise
    except Exception as error:  # whatever: nobody who builds a city wants a traceback
        _log.info("stage %s failed", name, exc_info=True)
        raise StageError(_failed(name, error)) from error


def _failed(name: str, error: Exception) -> str:
    return (
        f"world build: stage {name} failed ({sentence_of(error)} at {line_of(error)}), for no object in particular; "
        "move the window or mend the map there, and report this with what vico --verbose shows"
    )
