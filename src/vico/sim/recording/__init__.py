"""The run folder: what a simulation's recording holds, how it is written, and how it is read at any time.

::

    run.json                       what was run, and how far it came
    agents.json                    who takes part
    cast.jsonl                     which bodies come, change and go, and when
    segments/FIRST-LAST/*.parquet  some steps in a row: a file a table (`schema.TABLES`)
    checkpoints/STEP/              the exact state of the simulation and its agents
    views/AGENT/FIRST.mp4          what an agent saw, a frame a step
    community/                     who lives there, where no folder of theirs could be named
    setup.json setup.glb           what was done before the first step, where anything was
    metrics.json                   counts and seconds; written at the end

`vico.sim.recording.recorder.Recorder` writes it, `read_run` reads it. `docs/formats.md` describes it for other
programs.
"""

from vico.sim.recording.films import View
from vico.sim.recording.manifest import CastMember
from vico.sim.recording.run import AgentRecord, JointPoses, Moment, PosedPeople, Run, Tracks, read_run
from vico.sim.recording.schema import Checkpoint

__all__ = [
    "AgentRecord",
    "CastMember",
    "Checkpoint",
    "JointPoses",
    "Moment",
    "PosedPeople",
    "Run",
    "Tracks",
    "View",
    "read_run",
]
