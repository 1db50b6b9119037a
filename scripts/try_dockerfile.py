"""Run the steps of the Dockerfile without Docker: in a Debian folder, one after the other, as root through chroot.

    debootstrap --variant=minbase bookworm BASE           # stands for FROM debian:bookworm-slim; needs root
    python scripts/try_dockerfile.py --base BASE --then 'vico --version' --then 'vico world build --radius 60 --out w'

The base is copied first. What is obeyed: ARG, ENV, RUN, WORKDIR, COPY (with .dockerignore), USER, ENTRYPOINT and CMD,
in the forms that our Dockerfile has; any other line is refused, so that none is passed over. What is not tried is what
an engine does beside that: layers, its cache, its network, and pulling the base image. ``--host FILE`` copies a file of
this machine to the same place first, such as the certificates and the pip configuration of a network with its own.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[1]
_MOUNTS = ("/proc", "/dev")


def say(text: str) -> None:
    """Print a line at once, before what the next command prints."""
    sys.stdout.write(f"{text}\n")
    sys.stdout.flush()


@dataclass
class Image:
    """What the steps so far have come to."""

    root: Path
    environment: dict[str, str] = field(
        default_factory=lambda: {"PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin"}
    )
    arguments: dict[str, str] = field(default_factory=dict)
    folder: str = "/"
    user: str = ""
    entrypoint: list[str] = field(default_factory=list)
    command: list[str] = field(default_factory=list)

    def run(self, words: Sequence[str]) -> None:
        """Run a command in it; stop with its exit status if it fails."""
        names = {"HOME": "/root"} | self.environment | self.arguments
        switch = ["chroot", str(self.root)]
        if self.user:
            switch = ["chroot", f"--userspec={self.user}", str(self.root)]
            names["HOME"] = f"/home/{self.user}"
        inside = f"cd {shlex.quote(self.folder)} && exec {shlex.join(words)}"
        done = subprocess.run([*switch, "/bin/sh", "-c", inside], env=names, check=False)
        if done.returncode:
            sys.exit(f"{shlex.join(words)}: exit status {done.returncode}")

    def expand(self, text: str) -> str:
        """Put in values of variables, as Docker does in ENV, WORKDIR, COPY and USER."""
        known = self.environment | self.arguments
        return re.sub(r"\$\{?(\w+)\}?", lambda match: known.get(match[1], ""), text)


def steps_of(text: str) -> list[tuple[str, str]]:
    """Return the instructions of a Dockerfile, and what follows each; lines that are continued are one."""
    lines = [line for line in text.splitlines() if not line.lstrip().startswith("#")]
    whole = "\n".join(lines).replace("\\\n", " ")
    steps = []
    for line in whole.splitlines():
        if line.strip():
            name, _, rest = line.strip().partition(" ")
            steps.append((name.upper(), rest.strip()))
    return steps


def context(ignore: str) -> set[str]:
    """Return the files that .dockerignore leaves, by their paths: the last pattern that fits decides."""
    patterns = [line.strip() for line in ignore.splitlines() if line.strip() and not line.startswith("#")]
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout.splitlines()
    return {name for name in listed if (ROOT / name).is_file() and not _ignored(name, patterns)}


def _ignored(name: str, patterns: Sequence[str]) -> bool:
    ignored = False
    parts = name.split("/")
    heads = ["/".join(parts[: k + 1]) for k in range(len(parts))]
    for pattern in patterns:
        plain = pattern.removeprefix("!").removeprefix("**/")
        tails = [tail.rpartition("/")[2] for tail in heads] if "**/" in pattern else heads
        if any(fnmatch.fnmatchcase(tail, plain) for tail in tails):
            ignored = not pattern.startswith("!")
    return ignored


def copy(image: Image, rest: str, files: set[str]) -> None:
    """Do COPY: files by name, folders with what is in them."""
    *sources, to = image.expand(rest).split()
    target = image.root / os.path.join(image.folder, to).lstrip("/")
    for source in sources:
        name = source.removeprefix("./")
        inside = sorted(one for one in files if one == name or one.startswith(f"{name}/"))
        if not inside:
            sys.exit(f"COPY {source}: not there, or .dockerignore leaves it out")
        for one in inside:
            if one != name:
                place = target / one.removeprefix(f"{name}/")
            else:
                place = target / Path(name).name if to.endswith("/") else target
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / one, place)


def obey(image: Image, name: str, rest: str, files: set[str]) -> None:
    """Do one instruction."""
    if name == "ARG":
        key, _, value = rest.partition("=")
        image.arguments.setdefault(key, value)
    elif name == "ENV":
        for word in shlex.split(rest):
            key, _, value = word.partition("=")
            image.environment[key] = image.expand(value)
    elif name == "RUN":
        image.run(["/bin/sh", "-c", rest])
    elif name == "WORKDIR":
        image.folder = os.path.join(image.folder, image.expand(rest))
        (image.root / image.folder.lstrip("/")).mkdir(parents=True, exist_ok=True)
    elif name == "COPY":
        copy(image, rest, files)
    elif name == "USER":
        image.user = image.expand(rest)
    elif name in ("ENTRYPOINT", "CMD"):
        setattr(image, "entrypoint" if name == "ENTRYPOINT" else "command", json.loads(rest))
    else:
        sys.exit(f"{name} {rest}: this script does not know what to do; teach it")


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", type=Path, required=True, help="root folder of a Debian, as debootstrap makes it")
    parser.add_argument("--build-arg", action="append", default=[], metavar="NAME=VALUE")
    parser.add_argument(
        "--host", action="append", default=[], metavar="FILE", help="file of this machine to copy first"
    )
    parser.add_argument(
        "--env", action="append", default=[], metavar="NAME=VALUE", help="of the network, while it runs"
    )
    parser.add_argument("--then", action="append", default=[], metavar="COMMAND", help="run in the image afterwards")
    parser.add_argument("--keep", type=Path, help="where the image is left; without, it is deleted")
    given = parser.parse_args()
    if os.geteuid() != 0:
        parser.error("chroot is root's")
    steps = steps_of((ROOT / "Dockerfile").read_text(encoding="utf-8"))
    files = context((ROOT / ".dockerignore").read_text(encoding="utf-8"))
    with ExitStack() as stack:
        place = given.keep or Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="vico-image-")))
        root = place / "root"
        subprocess.run(["cp", "-a", str(given.base), str(root)], check=True)
        for path in ("/etc/resolv.conf", *given.host):
            (root / path.lstrip("/")).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, root / path.lstrip("/"))
        for path in _MOUNTS:
            subprocess.run(["mount", "--rbind", path, str(root / path.lstrip("/"))], check=True)
            subprocess.run(["mount", "--make-rslave", str(root / path.lstrip("/"))], check=True)
            stack.callback(subprocess.run, ["umount", "--recursive", str(root / path.lstrip("/"))], check=True)
        image = Image(root)
        image.environment |= dict(pair.split("=", 1) for pair in given.env)
        image.arguments |= dict(pair.split("=", 1) for pair in given.build_arg)
        for number, (name, rest) in enumerate(steps, 1):
            began = time.perf_counter()
            say(f"{number} of {len(steps)}: {name} {rest}")
            if name == "FROM":
                say(f"  {given.base.name} stands for it")
                continue
            obey(image, name, rest, files)
            say(f"  {time.perf_counter() - began:.1f} s")
        image.arguments.clear()
        for command in [shlex.join([*image.entrypoint, *image.command]), *given.then]:
            say(f"in the image: {command}")
            image.run(shlex.split(command))
        size = sum(
            path.stat().st_size for path in (root / "opt").rglob("*") if path.is_file() and not path.is_symlink()
        )
        say(f"done; /opt is {size / 1e6:,.0f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
