"""`vico assets`: packs that are fetched, and things that are made out of words."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import tyro
from tyro.conf import Positional
from tyro.extras import SubcommandApp

from vico.cli.generate import GenerateOptions

assets = SubcommandApp()


@assets.command(name="install")
def assets_install(
    what: Positional[Literal["people", "robots", "viewer", "things", "llm", "all"]] = "all",
    pack: Path | None = None,
    force: bool = False,
) -> int:
    """Fetch richer bodies, robots and furniture from the packages that ship them, and print their licences.

    Example: vico assets install people

    Args:
        what: Which pack. "llm" is a small language model (98 MB), which "all" leaves out.
        pack: For "things": a .deb of sweethome3d-furniture or a folder with its archives. Without it the one the
            system has, else what apt-get downloads.
        force: Fetch and prepare again.
    """
    from vico.cli import assets as verb

    return verb.install(what, pack=pack, force=force)


@assets.command(name="status")
def assets_status() -> int:
    """Say which packs are installed, with their licences."""
    from vico.cli import assets as verb

    return verb.status()


@assets.command(name="generate")
def assets_generate(options: Annotated[GenerateOptions, tyro.conf.arg(name="")]) -> int:
    """Make a thing out of words: a picture of them, a mesh of the picture, a model of the mesh. The extra "diffusion".

    Example: vico assets generate "a red post box" --size 1.2 --tag amenity=post_box --out my-data

    Example: vico assets generate "a tent" --size 1.6 --text-to-image sd-turbo --image-to-mesh shap-e --out my-data

    Example: vico assets generate "a kiosk" --size 2.7 --mesh kiosk.glb --licence MIT --credit "Jo Doe" --out my-data
    """
    from vico.cli import generate as verb

    return verb.generate(options)
