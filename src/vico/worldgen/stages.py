"""The stages of a build: run, timed, reported, and kept, so that a killed build resumes and one stage runs alone.

A stage is a function of typed inputs. What it made is kept in a file of its own together with a key: a digest of the
stage's name, of this package's code, and of all inputs. A later build whose stage has the same key reads the file
instead of computing. So a build that was killed goes on where it stopped, a build with one other option computes only
what depends on it, and a stage that is run again by name passes on nothing new unless its result is another.

A product is a tree of dataclasses, records, lists and arrays. It is written as one JSON tree whose leaves may point
at blobs; arrays that are shared in memory (a texture used by many surfaces) are written once and shared again after
reading. Only data classes, records and enumerations of this package are ever made from a file.
"""

from __future__ import annotations

import importlib
import json
import logging
import os
import struct
import time
import weakref
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cache
from hashlib import sha256
from pathlib import Path, PurePath
from typing import Any, TypeVar

import numpy as np
import pyarrow as pa
import shapely
from numpy.typing import NDArray
from pydantic import BaseModel
from shapely.errors import ShapelyError
from shapely.geometry.base import BaseGeometry

from vico.errors import MissingFileError, SchemaError, StageError, VicoError, line_of, sentence_of
from vico.geo.overlay import OverlayError
from vico.io.data_files import VARIABLE
from vico.io.files import write_bytes
from vico.threads import in_order
from vico.version import __version__
from vico.world.model import TRIED, Dropped, StageReport
from vico.worldgen.facts.fault_isolation import Losses, collect_losses

_MAGIC = b"vicoprod"
_MOST_BLOB = 2 << 30


class _Writer:
    def __init__(self) -> None:
        self.blobs: list[bytes | memoryview] = []
        self._known: dict[int, dict[str, Any]] = {}
        self._alive: list[Any] = []  # objects in `_known` must not be collected while their id is in use

    def blob(self, data: bytes | memoryview) -> int:
        self.blobs.append(data)
        return len(self.blobs) - 1

    def tree(self, value: Any) -> Any:
        if isinstance(value, Enum):
            return {"enum": _name_of(type(value)), "value": self.tree(value.value)}
        if value is None or isinstance(value, bool | str) or type(value) in (int, float):
            return value
        if isinstance(value, np.ndarray | BaseGeometry | bytes):
            if id(value) not in self._known:
                self._known[id(value)] = self._leaf(value)
                self._alive.append(value)
            return self._known[id(value)]
        if isinstance(value, np.generic):
            return {"scalar": value.dtype.str, "value": value.item()}
        if isinstance(value, BaseModel):
            return {"record": _name_of(type(value)), "value": value.model_dump(mode="json")}
        if is_dataclass(value) and not isinstance(value, type):
            content = {f.name: self.tree(getattr(value, f.name)) for f in fields(value)}
            return {"data": _name_of(type(value)), "value": content}
        if isinstance(value, list):
            return [self.tree(item) for item in value]
        if isinstance(value, tuple):
            return {"tuple": [self.tree(item) for item in value]}
        if isinstance(value, Mapping):
            return {"dict": [[self.tree(key), self.tree(item)] for key, item in value.items()]}
        if isinstance(value, set | frozenset):
            return {"set": sorted((self.tree(item) for item in value), key=json.dumps)}
        if isinstance(value, PurePath):
            return {"path": str(value)}
        raise TypeError(f"a product can't hold a {type(value).__module__}.{type(value).__qualname__}")

    def _leaf(self, value: NDArray[Any] | BaseGeometry | bytes) -> dict[str, Any]:
        if isinstance(value, bytes):
            return {"bytes": self.blob(value)}
        if isinstance(value, BaseGeometry):
            return {"shape": self.blob(shapely.to_wkb(value, include_srid=False))}
        if value.dtype == object:
            return {"objects": [self.tree(item) for item in value.ravel().tolist()], "of": list(value.shape)}
        return {
            # A view and no copy: the pages of a district's photos fill half a gigabyte.
            "array": self.blob(np.ascontiguousarray(value).reshape(-1).view(np.uint8).data),
            "type": value.dtype.str,
            "of": list(value.shape),
        }


class _Reader:
    def __init__(self, blobs: list[Any]) -> None:
        self._blobs = blobs
        self._known: dict[int, Any] = {}

    def value(self, node: Any) -> Any:
        if isinstance(node, list):
            return [self.value(item) for item in node]
        if not isinstance(node, dict):
            return node
        kind = next(iter(node))
        content = node[kind]
        if kind in ("array", "bytes", "shape"):
            if content not in self._known:
                self._known[content] = self._leaf(kind, node)
            return self._known[content]
        if kind == "objects":
            array = np.empty(len(content), object)
            array[:] = [self.value(item) for item in content]
            return array.reshape(node["of"])
        if kind == "scalar":
            return np.dtype(content).type(node["value"])
        if kind == "tuple":
            return tuple(self.value(item) for item in content)
        if kind == "dict":
            return {self.value(key): self.value(item) for key, item in content}
        if kind == "set":
            return {self.value(item) for item in content}
        if kind == "path":
            return Path(content)
        made = _type_of(content)
        if kind == "enum" and issubclass(made, Enum):
            return made(self.value(node["value"]))
        if kind == "record" and issubclass(made, BaseModel):
            return made.model_validate_json(json.dumps(node["value"]))
        if kind == "data" and is_dataclass(made):
            given = {f.name for f in fields(made) if f.init}
            make: Any = made
            return make(**{name: self.value(item) for name, item in node["value"].items() if name in given})
        raise ValueError(f"unknown kind {kind!r}")

    def _leaf(self, kind: str, node: dict[str, Any]) -> Any:
        data = self._blobs[node[kind]]
        if kind == "bytes":
            return bytes(data)
        if kind == "shape":
            return shapely.from_wkb(bytes(data))
        # The array lives in what was decompressed, which can be written to.
        return np.frombuffer(data, np.dtype(node["type"])).reshape(node["of"])


def _name_of(kind: type) -> str:
    if not kind.__module__.startswith("vico."):
        raise TypeError(f"a product can't hold a {kind.__module__}.{kind.__qualname__}")
    return f"{kind.__module__}:{kind.__qualname__}"


def _type_of(name: str) -> Any:
    module, _, path = str(name).partition(":")
    if not module.startswith("vico."):
        raise ValueError(f"{name!r} is none of our types")
    found: Any = importlib.import_module(module)
    for part in path.split("."):
        found = vars(found)[part]
    if not (isinstance(found, type) and (is_dataclass(found) or issubclass(found, BaseModel | Enum))):
        raise ValueError(f"{name!r} is no record")
    return found


def encode_product(value: Any) -> tuple[bytes, list[bytes | memoryview]]:
    """Return the tree of a product as JSON, and its blobs."""
    writer = _Writer()
    tree = json.dumps(writer.tree(value), separators=(",", ":"), ensure_ascii=False).encode()
    return tree, writer.blobs


def digest_of(value: Any) -> str:
    """SHA-256 of a product: equal content, equal digest, in any process."""
    return _digest(*encode_product(value))


def _digest(tree: Any, blobs: list[Any]) -> str:
    total = sha256(struct.pack("<Q", len(tree)))
    total.update(tree)
    for blob in blobs:
        total.update(struct.pack("<Q", len(blob)))
        total.update(blob)
    return total.hexdigest()


def write_product(path: Path, value: Any, *, key: str) -> str:
    """Write a product with the key it was made under, whole or not at all; return its digest."""
    tree, blobs = encode_product(value)
    digest = _digest(tree, blobs)
    codec = pa.Codec("zstd", compression_level=1)
    small = list(in_order(lambda blob: codec.compress(blob, asbytes=True), (tree, *blobs)))
    sizes = [(len(raw), len(s)) for raw, s in zip((tree, *blobs), small, strict=True)]
    head = json.dumps({"key": key, "digest": digest, "sizes": sizes}).encode()
    write_bytes(path, [_MAGIC, struct.pack("<Q", len(head)), head, *small])
    return digest


def read_head(path: Path) -> tuple[str, str]:
    """Key and digest of a product; what to compare before reading it whole.

    Raises
    ------
    SchemaError
        If it is damaged.
    """
    head, _ = _head(path)
    return str(head["key"]), str(head["digest"])


def _head(path: Path) -> tuple[dict[str, Any], int]:
    try:
        with path.open("rb") as file:
            start = file.read(16)
            (length,) = struct.unpack("<Q", start[8:])
            if start[:8] != _MAGIC or length > 64 << 20:
                raise ValueError("no stage product")
            head = json.loads(file.read(length))
        if not {"key", "digest", "sizes"} <= set(head):
            raise ValueError("its head is incomplete")
    except (OSError, ValueError, struct.error, TypeError) as error:
        raise SchemaError(f"{path}: not a readable stage product ({error}); build the world anew") from None
    return head, 16 + length


def read_product(path: Path) -> tuple[Any, str]:
    """Read what `write_product` wrote: the product and its digest.

    Raises
    ------
    SchemaError
        If the file is damaged (its digest is checked) or holds anything but our records.
    """
    head, start = _head(path)
    try:
        data = memoryview(path.read_bytes())
        codec = pa.Codec("zstd")
        parts = []
        for raw, small in head["sizes"]:
            if not 0 <= raw <= _MOST_BLOB or not 0 <= small <= len(data) - start:
                raise ValueError("truncated")
            chunk = data[start : start + small]
            parts.append(codec.decompress(chunk, raw) if raw else bytearray())
            start += small
        tree, blobs = parts[0], parts[1:]
        if _digest(tree, list(blobs)) != head["digest"]:
            raise ValueError("its content is not what its digest says")
        value = _Reader(blobs).value(json.loads(bytes(tree)))
    except (OSError, ValueError, KeyError, IndexError, TypeError, AttributeError, ImportError, ShapelyError) as error:
        raise SchemaError(f"{path}: not a readable stage product ({error}); build the world anew") from None
    return value, str(head["digest"])


Progress = Callable[[str, int, int], None]
T = TypeVar("T")

_log = logging.getLogger(__name__)
_CODE = ("*.py", *(f"{room}/**/*.py" for room in ("io", "geo", "world", "assets", "render", "worldgen", "llm")))
_DATA = ("data/**/*.toml",)
SUFFIX = ".stage"


@dataclass(frozen=True)
class _StageFile:
    """Content of a stage's file: what it made, what it left out, and of how many objects (0 if nothing)."""

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

    def register(self, value: T, digest: str) -> T:
        """Make an input known by a digest of its own (of the file it was read from), and return it."""
        try:
            # Known as long as it is referenced: the meshes and photos of a district would fill gigabytes.
            self._digests[id(value)] = weakref.ref(value), digest
        except TypeError:
            if not isinstance(value, tuple):  # tuples are taken apart: none is the input of a stage
                self._digests[id(value)] = lambda: value, digest
        return value

    def register_value(self, value: T) -> T:
        """Take the digest of a value that is the input of several stages, once, and return the value."""
        return self.register(value, digest_of(value))

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
    def timer(self, name: str) -> Iterator[None]:
        """Time a step that keeps no product: reading the sources, writing files, taking pictures."""
        self._tell(name, 0)
        start = time.perf_counter()
        with _stage_errors(name) as losses:
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
            with _stage_errors(name) as losses:
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
                return self.register(known[0].value, known[1])
        with _stage_errors(name) as losses:
            value = function(*inputs, **options)
        product = _StageFile(value, losses.dropped, len(losses.tried) if losses.dropped else 0)
        self._report_losses(name, product.dropped, product.tried)
        return self.register(value, write_product(path, product, key=key))

    def _read(self, path: Path, key: str) -> tuple[_StageFile, str] | None:
        """Read the product, if it was made under this key and is whole: a torn one is simply made anew."""
        try:
            made, digest = read_product(path) if read_head(path)[0] == key else (None, "")
        except SchemaError:
            os.unlink(path)
            return None
        return (made, digest) if isinstance(made, _StageFile) else None


def store_product(folder: Path, name: str, value: Any) -> str:
    """Keep something as what a stage made, for `load_product` in another build; return its digest."""
    folder.mkdir(parents=True, exist_ok=True)
    return write_product(folder / f"{name}{SUFFIX}", _StageFile(value, [], 0), key="")


def load_product(folder: Path, name: str) -> tuple[Any, str]:
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
    if not isinstance(made, _StageFile):
        raise SchemaError(f"{path}: is no product of a stage; plan the tiles of the city anew")
    return made.value, digest


@contextmanager
def _stage_errors(name: str) -> Iterator[Losses]:
    """Listen to a stage; what fails in it, for no object in particular, ends the build in a sentence."""
    try:
        with collect_losses() as losses:
            yield losses
    except OverlayError as error:
        _log.info("stage %s failed", name, exc_info=True)
        raise StageError(_failure_sentence(name, error)) from error
    except (VicoError, OSError, MemoryError):
        raise
    except Exception as error:  # whatever: nobody who builds a city wants a traceback
        _log.info("stage %s failed", name, exc_info=True)
        raise StageError(_failure_sentence(name, error)) from error


def _failure_sentence(name: str, error: Exception) -> str:
    return (
        f"world build: stage {name} failed ({sentence_of(error)} at {line_of(error)}), for no object in particular; "
        "move the window or mend the map there, and report this with what vico --verbose shows"
    )
