"""Keep the episodes of a table in one file, and lay them out again, so that it goes on elsewhere.

    python benchmarks/kept_episodes.py pack OUT FILE.jsonl      # OUT is what benchmarks/tables.py wrote
    python benchmarks/kept_episodes.py unpack FILE.jsonl OUT    # then benchmarks/tables.py --out OUT goes on

A line is one file of OUT, an episode's record or its task: its path and its content. Records are known by a key of the
code, the world, the task and the setting, so with other code or other worlds they are played again.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path, PurePosixPath
from typing import Any

from vico.errors import SchemaError, VicoError
from vico.io.files import read_json, write_bytes, write_json

_KEPT = ("*/episodes/*.json", "*/tasks/*.json")


def pack(out: Path, file: Path) -> int:
    """Write all records and tasks under `out` to a file; return how many."""
    paths = sorted(path for pattern in _KEPT for path in out.glob(pattern))
    rows = [{"path": path.relative_to(out).as_posix(), "content": kept(read_json(path))} for path in paths]
    lines = [json.dumps(row, sort_keys=True, ensure_ascii=False, separators=(",", ":")) for row in rows]
    write_bytes(file, "".join(line + "\n" for line in lines).encode())
    return len(lines)


def kept(content: dict[str, Any]) -> dict[str, Any]:
    """Return a record without where a policy lay: its hash, which stays, says which it was."""
    setting = content.get("episode", {}).get("setting", {})
    if "policy" in setting:
        setting["policy"] = PurePosixPath(setting["policy"]).name
    return content


def unpack(file: Path, out: Path) -> int:
    """Write the records and tasks of a file under `out`, but for those that are there; return how many.

    Raises
    ------
    SchemaError
        If a line is none that `pack` writes.
    """
    written = 0
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
        try:
            row = json.loads(line)
            path, content = PurePosixPath(row["path"]), row["content"]
        except (ValueError, KeyError, TypeError) as error:
            raise SchemaError(f"{file}: line {number} is no kept episode ({error}); pack it anew") from None
        if not any(path.match(pattern) for pattern in _KEPT) or len(path.parts) != 3 or ".." in path.parts:
            raise SchemaError(f"{file}: line {number}: {path} is no episode nor task of a table; pack it anew")
        if not (out / path).exists():
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            write_json(out / path, content)
            written += 1
    return written


def main() -> int:
    """Pack or unpack."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("pack", "unpack"))
    parser.add_argument("source", type=Path)
    parser.add_argument("target", type=Path)
    arguments = parser.parse_args()
    try:
        count = (pack if arguments.what == "pack" else unpack)(arguments.source, arguments.target)
    except (VicoError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{count} files")
    return 0


if __name__ == "__main__":
    sys.exit(main())
