"""Wheels are fetched by pip from a local folder here: the same code path, without the network."""

import base64
import hashlib
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from vico.assets.packages import FetchError, IntegrityError, Package, extract, fetch, installed_folder


def wheel(folder: Path, members: dict[str, bytes]) -> Path:
    """Write a wheel that pip accepts."""
    path = folder / "shapes_of_ours-1.0-py3-none-any.whl"
    info = "shapes_of_ours-1.0.dist-info"
    files = members | {
        f"{info}/METADATA": b"Metadata-Version: 2.1\nName: shapes-of-ours\nVersion: 1.0\n",
        f"{info}/WHEEL": b"Wheel-Version: 1.0\nGenerator: test\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
    }
    rows = []
    for name, content in files.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        rows.append(f"{name},sha256={digest},{len(content)}")
    files[f"{info}/RECORD"] = ("\n".join(rows) + f"\n{info}/RECORD,,\n").encode()
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


@pytest.fixture
def shelf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder pip looks into instead of any index, and a cache of its own."""
    folder = tmp_path / "shelf"
    folder.mkdir()
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    monkeypatch.setenv("VICO_CACHE", str(tmp_path / "cache"))
    return folder


def package(path: Path, members: tuple[str, ...], digest: str | None = None) -> Package:
    digest = digest or hashlib.sha256(path.read_bytes()).hexdigest()
    return Package("shapes-of-ours", "1.0", (digest,), "MIT", "Thanks to nobody.", members)


def test_only_the_wanted_members_are_extracted(shelf: Path) -> None:
    path = wheel(shelf, {"shapes/a.obj": b"a", "shapes/code.py": b"boom = 1 / 0"})
    folder = fetch(package(path, ("shapes/*.obj",)))
    assert sorted(p.name for p in folder.rglob("*") if p.is_file()) == ["a.obj", "package.json"]


def test_licence_and_credits_are_said(shelf: Path) -> None:
    said: list[str] = []
    fetch(package(wheel(shelf, {"shapes/a.obj": b"a"}), ("shapes/*.obj",)), say=said.append)
    assert any("MIT" in s and "Thanks to nobody" in s for s in said)


def test_a_file_with_another_digest_is_refused_and_nothing_is_kept(shelf: Path, tmp_path: Path) -> None:
    wanted = package(wheel(shelf, {"shapes/a.obj": b"a"}), ("shapes/*.obj",), digest="0" * 64)
    with pytest.raises(IntegrityError, match="SHA-256"):
        fetch(wanted)
    assert installed_folder(wanted) is None
    assert not (tmp_path / "cache").exists()


def test_a_package_that_pip_cannot_find_is_one_clear_sentence(shelf: Path) -> None:
    with pytest.raises(FetchError, match=r"pip cannot download no-such-thing-of-ours==9\.9 .*our own models"):
        fetch(Package("no-such-thing-of-ours", "9.9", ("0",), "", "", ("*",)))


def test_what_is_installed_is_not_fetched_again(shelf: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = package(wheel(shelf, {"shapes/a.obj": b"a"}), ("shapes/*.obj",))
    first = fetch(wanted)
    monkeypatch.setattr(subprocess, "run", lambda *_, **__: pytest.fail("pip was called"))
    assert fetch(wanted) == first


def test_wanting_other_members_makes_an_install_stale(shelf: Path) -> None:
    path = wheel(shelf, {"shapes/a.obj": b"a", "shapes/b.obj": b"b"})
    fetch(package(path, ("shapes/a.obj",)))
    assert installed_folder(package(path, ("shapes/b.obj",))) is None


@pytest.mark.parametrize("name", ["../evil.obj", "/evil.obj", "a/../../evil.obj", "C:evil.obj"])
def test_members_that_leave_the_folder_are_refused(tmp_path: Path, name: str) -> None:
    path = tmp_path / "evil.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(name, b"evil")
    with pytest.raises(IntegrityError, match="unsafe"):
        extract(path, ("*",), tmp_path / "out")
    assert not (tmp_path / "evil.obj").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="no links in zips there")
def test_links_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "link.zip"
    with zipfile.ZipFile(path, "w") as archive:
        entry = zipfile.ZipInfo("link.obj")
        entry.external_attr = 0o120777 << 16
        archive.writestr(entry, "/etc/passwd")
    with pytest.raises(IntegrityError, match="unsafe"):
        extract(path, ("*",), tmp_path / "out")


def test_more_bytes_than_allowed_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "bomb.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.obj", bytes(1 << 20))
    with pytest.raises(IntegrityError, match="larger"):
        extract(path, ("*",), tmp_path / "out", size_limit=1 << 19)


def test_a_damaged_archive_is_said_to_be_damaged(tmp_path: Path) -> None:
    path = tmp_path / "half.zip"
    path.write_bytes(b"PK\x03\x04 and then nothing")
    with pytest.raises(IntegrityError, match="damaged"):
        extract(path, ("*",), tmp_path / "out")
