"""Make the API reference, a page a module, from the docstrings; needs the extra "docs".

    python scripts/api_reference.py out/api

A module that does not import, or a name in ``__all__`` that does not resolve, is an error.
"""

from __future__ import annotations

import argparse
import pkgutil
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path

# First: pdoc keeps modules that it imports from starting processes, and the library of MuJoCo's window starts one.
import mujoco  # noqa: F401
import pdoc
import pdoc.render

import vico


def modules() -> Iterator[str]:
    """Yield the dotted names of all modules of the package, the command line's aside."""
    yield "vico"
    for found in pkgutil.walk_packages(vico.__path__, "vico."):
        private = any(part.startswith("_") for part in found.name.split("."))
        if not private and not found.name.startswith("vico.cli"):
            yield found.name


def main() -> int:
    """Run from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, help="folder for the pages")
    out: Path = parser.parse_args().out
    # What is broken is an error; packages that bring their modules along, and names in annotations of named tuples
    # that only type checkers see, are none.
    warnings.simplefilter("ignore", UserWarning)
    for broken in (".*does not resolve", "Couldn't import", "Error importing"):
        warnings.filterwarnings("error", message=broken, category=UserWarning)
    for name in vico.__all__:
        getattr(vico, name)  # imported when they are first asked for, which a reader of the source cannot see
    pdoc.render.configure(docformat="numpy", footer_text=f"Virtual Community {vico.__version__}")
    out.mkdir(parents=True, exist_ok=True)
    names = list(modules())
    # What packages bring along beside these is nobody's to import, and may need packages that are not there.
    pdoc.pdoc(*names, r"!vico\.(.*\.)?_", output_directory=out)
    sys.stdout.write(f"{out / 'index.html'}: {len(names)} modules\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
