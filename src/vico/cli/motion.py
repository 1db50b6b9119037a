"""`vico motion`: motions of other programs, and those of a recorded run."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from vico.assets.motions import MotionClip, import_motion, read_gltf_motion, smplx_of
from vico.cli.output import check_output, print_json, print_table
from vico.errors import InputError
from vico.io.files import new_file
from vico.sim.recording.joint_poses import motion_of
from vico.sim.recording.run import read_run
from vico.viewer.motion_sheet import motion_sheet


def convert(path: Path, *, out: Path, animation: str, sheet: Path | None, force: bool, json: bool) -> int:
    """Read a motion and write it as ours (.motion) or as SMPL-X (.npz)."""
    clip = read_gltf_motion(path, animation=animation) if animation else import_motion(path)
    code = _written(clip, path, out=out, sheet=sheet, force=force, json=json)
    for note in clip.notes:
        print(f"{path}: {note}", file=sys.stderr)
    return code


def of_run(run: Path, *, agent: str, out: Path, sheet: Path | None, force: bool, json: bool) -> int:
    """Write the recorded motion of one person."""
    return _written(motion_of(read_run(run), agent), run, out=out, sheet=sheet, force=force, json=json)


def _written(clip: MotionClip, source: Path, *, out: Path, sheet: Path | None, force: bool, json: bool) -> int:
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
