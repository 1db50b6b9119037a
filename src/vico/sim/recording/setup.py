"""What was done to a simulation before its first step, as a run folder keeps it: enough to do the same again.

::

    setup.json     calls of `vico.sim.scenario.Scenario`, in order
    setup.glb      shapes of the objects that were added, a node a prototype

Neither is there where nothing was done.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import Field, ValidationError

from vico.errors import SchemaError
from vico.io.files import read_json, write_json
from vico.sim.recording.schema import SETUP, SETUP_SHAPES
from vico.sim.scenario import AddedObject, GivenCash, HandedObject, PlacedAgent, Scenario
from vico.world.glb import read_glb, write_glb
from vico.world.model import Record

if TYPE_CHECKING:
    from vico.sim.simulation import Simulation

_SCHEMA, _VERSION = "vico.setup", 1


class _Setup(Record):
    """``setup.json``."""

    schema_name: Literal["vico.setup"]
    version: Literal[1]
    calls: list[Annotated[AddedObject | HandedObject | PlacedAgent | GivenCash, Field(discriminator="call")]]


def write_setup(out: Path, sim: Simulation) -> None:
    """Keep what was done to a simulation so far; nothing is written if that is nothing.

    Parameters
    ----------
    out
        Run folder.
    """
    calls = sim.scenario.calls
    if not calls:
        return
    shown = {call.prototype for call in calls if isinstance(call, AddedObject | HandedObject)}
    if shown:
        write_glb(out / SETUP_SHAPES, {name: sim.shapes[name] for name in sorted(shown)})
    content = {"schema_name": _SCHEMA, "version": _VERSION, "calls": [call.model_dump(mode="json") for call in calls]}
    write_json(out / SETUP, content)


def repeat_setup(path: Path, scenario: Scenario) -> None:
    """Do to a fresh simulation what a run folder says was done to the recorded one.

    Parameters
    ----------
    path
        Run folder; one without `setup.json` says that nothing was done.

    Raises
    ------
    SchemaError
        If the files are damaged.
    InputError
        If something can't be done: it is another simulation than the recorded one.
    """
    if not (path / SETUP).exists():
        return
    try:
        calls = _Setup.model_validate(read_json(path / SETUP)).calls
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the whole file"
        raise SchemaError(f"{path / SETUP}: {where}: {first['msg']}; record the run anew") from None
    shapes = read_glb(path / SETUP_SHAPES) if (path / SETUP_SHAPES).exists() else {}
    for call in calls:
        if isinstance(call, AddedObject | HandedObject) and call.prototype not in shapes:
            raise SchemaError(f"{path / SETUP_SHAPES}: has no shape {call.prototype!r}; record the run anew")
        scenario.repeat(call, shapes)
