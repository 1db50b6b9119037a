"""Stores of files for several machines: a folder they share, or an object store (the extra ``s3``).

A store is named by a folder, or by a URL that fsspec knows (``s3://bucket/prefix``). What is in it has names with
slashes. Files appear whole or not at all; who writes the same name last wins, so what is written must not depend on who
writes it.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any, Protocol

from vico.errors import InputError, MissingExtraError, OutputError, SourceError
from vico.io.files import reason_of, remove_path, write_bytes

_THREADS = 16  # files that travel at a time


class Store(Protocol):
    """Files by name."""

    def read(self, name: str) -> bytes | None:
        """Return what a file holds; None if there is none.

        Raises
        ------
        SourceError
            If the store does not answer, or not to us.
        """

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all.

        Raises
        ------
        OutputError
            If it cannot be written.
        """

    def has(self, name: str) -> bool:
        """Return whether there is a file, or a folder with something in it, of a name."""

    def names(self, folder: str) -> list[str]:
        """Return the names, within a folder, of its files; sorted, none if there is no such folder."""

    def new_folder(self, name: str, *, last: str = "") -> AbstractContextManager[Path]:
        """Give a block a path at which it makes a folder, which is in the store afterwards.

        Parameters
        ----------
        last
            The file that says that the folder is whole: where files are copied it is the last one.
        """

    def fetch_folder(self, name: str, out: Path) -> None:
        """Copy a folder, with the folders in it, to `out`, which is made."""

    def remove(self, name: str) -> None:
        """Take away a file or a whole folder; nothing happens where there is none."""


def is_url(place: str | Path) -> bool:
    """Return whether a place is a URL, and no path of this machine."""
    return "://" in str(place)


def store_at(place: str | Path) -> Store:
    """Return the store of a folder, or of a URL.

    Raises
    ------
    InputError
        If nothing is known of such URLs.
    MissingExtraError
        If what they need is not installed.
    """
    return ObjectStore(str(place)) if is_url(place) else FolderStore(Path(place))


class FolderStore:
    """A folder of this machine, or one that several machines share.

    Parameters
    ----------
    folder
        It is made when something is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def __str__(self) -> str:
        return str(self.folder.absolute())

    def read(self, name: str) -> bytes | None:
        """Return what a file holds; None if there is none."""
        try:
            return (self.folder / name).read_bytes()
        except (FileNotFoundError, NotADirectoryError, IsADirectoryError):
            return None
        except OSError as error:
            raise SourceError(f"{self.folder / name}: cannot be read: {reason_of(error, writing=False)}") from None

    def write(self, name: str, content: bytes) -> None:
        """Write a file, whole or not at all."""
        write_bytes(self.folder / name, content)

    def has(self, name: str) -> bool:
        """Return whether there is a file or a folder of a name."""
        return (self.folder / name).exists()

    def names(self, folder: str) -> list[str]:
        """Return the names, within a folder, of its files; those that are being written are none."""
        root = self.folder / folder
        found = (path.relative_to(root).as_posix() for path in root.rglob("*") if path.is_file())
        return sorted(name for name in found if not name.rpartition("/")[2].startswith("."))

    @contextmanager
    def new_folder(self, name: str, *, last: str = "") -> Iterator[Path]:
        """Give a block the path of the folder itself."""
        yield self.folder / name

    def fetch_folder(self, name: str, out: Path) -> None:
        """Copy a folder."""
        shutil.copytree(self.folder / name, out)

    def remove(self, name: str) -> None:
        """Take away a file or a whole folder."""
        remove_path(self.folder / name)


class ObjectStore:
    """A place in an object store, by fsspec.

    Parameters
    ----------
    url
        ``PROTOCOL://BUCKET/PREFIX``. Where it is and who we are is said as the protocol's own tools want it: for S3 in
        the environment (``AWS_ENDPOINT_URL``, ``AWS_ACCESS_KEY_ID``, ...) or in ``~/.aws``.
    """

    def __init__(self, url: str) -> None:
        self._files, self._root = _file_system(url)
        self.url = url.rstrip("/")

    def __str__(self) -> str:
        return self.url

    def read(self, name: str) -> bytes | None:
        """Return what a file holds; None if there is none."""
        try:
            with _errors(self._url(name), SourceError, "cannot be read"):
                content: bytes = self._files.cat_file(self._path(name))
                return content
        except FileNotFoundError:
            return None

    def write(self, name: str, content: bytes) -> None:
        """Write a file: an object store shows it when all of it is there."""
        try:
            with _errors(self._url(name), OutputError, "cannot be written"):
                self._files.pipe_file(self._path(name), content)
        except FileNotFoundError:
            raise OutputError(f"{self.url}: there is no such bucket; make it, or give another") from None

    def has(self, name: str) -> bool:
        """Return whether there is a file, or a folder with something in it, of a name."""
        with _errors(self._url(name), SourceError, "cannot be read"):
            self._files.invalidate_cache()
            found: bool = self._files.exists(self._path(name))
            return found

    def names(self, folder: str) -> list[str]:
        """Return the names, within a folder, of its files."""
        root = self._path(folder)
        try:
            with _errors(self._url(folder), SourceError, "cannot be read"):
                self._files.invalidate_cache()
                return sorted(path.removeprefix(root).lstrip("/") for path in self._files.find(root))
        except FileNotFoundError:
            return []

    @contextmanager
    def new_folder(self, name: str, *, last: str = "") -> Iterator[Path]:
        """Give a block a path on this machine; what it made there replaces what is in the store when it ends well.

        Folders whose names begin with a dot stay behind: what they hold can be made again.
        """
        with tempfile.TemporaryDirectory(prefix="vico-") as temporary:
            path = Path(temporary) / Path(name).name
            yield path
            files = [found.relative_to(path).as_posix() for found in sorted(path.rglob("*")) if found.is_file()]
            files = [one for one in files if not one.startswith(".") and "/." not in one]
            if files:
                self.remove(name)
            for part in ([one for one in files if one != last], [one for one in files if one == last]):
                self._put(path, name, part)

    def _put(self, path: Path, name: str, files: list[str]) -> None:
        with _errors(self._url(name), OutputError, "cannot be written"):
            if files:
                theirs = [self._path(f"{name}/{one}") for one in files]
                self._files.put([str(path / one) for one in files], theirs, batch_size=_THREADS)

    def fetch_folder(self, name: str, out: Path) -> None:
        """Copy a folder to this machine."""
        names = self.names(name)
        theirs = [f"{self._path(name)}/{one}" for one in names]
        for one in names:
            (out / one).parent.mkdir(parents=True, exist_ok=True)
        with _errors(self._url(name), SourceError, "cannot be read"):
            self._files.get(theirs, [str(out / one) for one in names], batch_size=_THREADS)

    def remove(self, name: str) -> None:
        """Take away a file or a whole folder."""
        try:
            with _errors(self._url(name), OutputError, "cannot be taken away"):
                self._files.invalidate_cache()
                self._files.rm(self._path(name), recursive=True)
        except FileNotFoundError:
            return

    def _path(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    def _url(self, name: str) -> str:
        return f"{self.url}/{name}"


def _file_system(url: str) -> tuple[Any, str]:
    """Return fsspec's file system of a URL, and the path in it."""
    protocol = url.partition("://")[0]
    try:
        import fsspec
    except ImportError:
        raise MissingExtraError("object stores need fsspec: pip install 'virtual-community[s3]'") from None
    try:
        # What others write meanwhile must be seen: no listing is kept.
        files, root = fsspec.url_to_fs(url, use_listings_cache=False, skip_instance_cache=True)
    except ImportError as error:
        mend = "pip install 'virtual-community[s3]'" if protocol == "s3" else "install what fsspec names"
        raise MissingExtraError(f"{url}: {protocol}:// needs more ({error}): {mend}") from None
    except ValueError as error:
        raise InputError(f"{url}: {error}; give s3://BUCKET/PREFIX, or a folder") from None
    if not url.partition("://")[2].strip("/"):
        raise InputError(f"{url}: names no bucket; give {protocol}://BUCKET/PREFIX")
    return files, str(root).rstrip("/")


@contextmanager
def _errors(url: str, kind: type[OutputError] | type[SourceError], what: str) -> Iterator[None]:
    """Turn whatever a store says, but that there is no such file, into one sentence."""
    try:
        yield
    except (FileNotFoundError, OutputError, SourceError):
        raise
    except Exception as error:  # each protocol has its own
        said = " ".join(str(error).split())[:200] or type(error).__name__
        raise kind(f"{url}: {what}: {said}; check the address and the keys in the environment") from None
