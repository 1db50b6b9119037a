"""`vico motion import` and `vico motion of-run`: motions of other programs, and those of a recorded run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from tyro.conf import Positional
from tyro.extras import SubcommandApp

if TYPE_CHECKING:
    from vico.assets.motions import MotionClip

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
    from vico.assets.motions import import_motion, read_gltf_motion

    clip = read_gltf_motion(path, animation=animation) if animation else import_motion(path)
    return _write(clip, path, out=out, sheet=sheet, force=force, json=json)


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
    from vico.sim.recording.run import motion_of, read_run

    return _write(motion_of(read_run(run), agent), run, out=out, sheet=sheet, force=force, json=json)


def _write(clip: MotionClip, source: Path, *, out: Path, sheet: Path | None, force: bool, json: bool) -> int:
    """Write a clip in the format of the file's name, draw it where asked, and print what it is."""
    import numpy as np
    from PIL import Image

    from vico.assets.motions import smplx_of
    from vico.cli.output import check_output, print_json, print_table
    from vico.errors import InputError
    from vico.io.files import new_file
    from vico.viewer.motion_sheet import motion_sheet

    if out.suffix not in (".motion", ".npz"):
        raise InputError(f"motion: {out}: write .motion (ours) or .npz (SMPL-X, as AMASS has it)")
    for path in (out, *([sheet] if sheet else [])):
        check_output(path, source, force=force)
    if out.suffix == ".motion":
        clip.write(out)
    else:
        with new_file(out) as path, path.open("wb") as file:
            np.savez_compressed(file, allow_pickle=False, **smplx_of(clip))
    if sheet is not None:
        with new_file(sheet) as path:
            Image.fromarray(motion_sheet(clip)).save(path, format="PNG")
    told = {"name": clip.name, "frames": len(clip), "rate": round(clip.rate, 3), "seconds": round(clip.seconds, 3)}
    if json:
        print_json(told)
    else:
        print_table(str(out), told)
    return 0
