"""The verbs for motions: `vico motion import` and `vico motion of-run`."""

from __future__ import annotations

from pathlib import Path

from tyro.conf import Positional
from tyro.extras import SubcommandApp

motion = SubcommandApp()


@motion.command(name="import")
def motion_import(
    path: Positional[Path],
    out: Path,
    animation: str = "",
    sheet: Path | None = None,
    force: bool = False,
    json: bool = False,
) -> int:
    """Read a motion of a BVH, AMASS (.npz) or glTF file, and write it on our skeleton.

    Example: vico motion import 01_01.bvh --out jump.motion --sheet jump.png

    Example: vico motion import dance.glb --animation samba --out samba.npz

    Args:
        path: The file; a .motion of ours can be turned into SMPL-X.
        out: File to write: .motion (ours) or .npz (SMPL-X, as AMASS has it).
        animation: Name of one of a glTF file's animations; the first without.
        sheet: Draw the motion into this picture.
        force: Replace files that are there.
        json: Print what was read as JSON.
    """
    from vico.cli import motion as verb

    return verb.convert(path, out=out, animation=animation, sheet=sheet, force=force, json=json)


@motion.command(name="of-run")
def motion_of_run(
    run: Positional[Path], agent: str, out: Path, sheet: Path | None = None, force: bool = False, json: bool = False
) -> int:
    """Write how one person moved in a recorded run, a frame a step.

    Example: vico motion of-run out/run --agent resident_0 --out resident_0.npz

    Args:
        run: Run folder.
        agent: The person's name.
        out: File to write: .motion (ours) or .npz (SMPL-X, as AMASS has it).
        sheet: Draw the motion into this picture.
        force: Replace files that are there.
        json: Print what was written as JSON.
    """
    from vico.cli import motion as verb

    return verb.of_run(run, agent=agent, out=out, sheet=sheet, force=force, json=json)
