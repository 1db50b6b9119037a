"""From checked commands to changes of the state: one short entry an action."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from vico.sim import handling, moves, rides
from vico.sim.actions import EARSHOT, Command
from vico.sim.stage import Stage
from vico.sim.state import Posture


def perform(command: Command, agent: int, stage: Stage) -> None:
    """Do what `check` allowed. The state must be the one it was checked against."""
    if agent >= len(stage.people):
        if command.kind == "control":
            assert stage.robots is not None
            stage.robots.command(agent - len(stage.people), np.array(command.values["vector"], np.float64))
        return
    _EFFECTS[command.kind](command.values, agent, stage)


def _communicate(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    p = stage.people
    hearers = stage.hearers(i, values.get("range", EARSHOT))
    stage.events.say(p.names[i], values["text"], p.position[i], hearers)
    moves.gesture("talk", i, stage)


def _complete(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    p = stage.people
    stage.events.add(
        "task_complete", p.names[i], f"reports task {values['index']} done", p.position[i], index=values["index"]
    )


def _posture(posture: Posture) -> Callable[[Mapping[str, Any], int, Stage], None]:
    return lambda values, i, stage: moves.settle_posture(posture, i, stage)


def _gesture(clip: str) -> Callable[[Mapping[str, Any], int, Stage], None]:
    return lambda values, i, stage: moves.gesture(clip, i, stage)


def _nothing(values: Mapping[str, Any], i: int, stage: Stage) -> None:
    return None


_EFFECTS: dict[str, Callable[[Mapping[str, Any], int, Stage], None]] = {
    "move_forward": moves.move_forward,
    "turn_left": lambda values, i, stage: moves.turn(values["degrees"], i, stage),
    "turn_right": lambda values, i, stage: moves.turn(-values["degrees"], i, stage),
    "look_at": moves.look_at,
    "pick": handling.pick,
    "put": handling.put,
    "hand_over": handling.hand_over,
    "enter": moves.enter,
    "exit": lambda values, i, stage: moves.leave(i, stage),
    "enter_bus": lambda values, i, stage: rides.board(i, stage),
    "exit_bus": lambda values, i, stage: rides.alight(i, stage),
    "enter_bike": lambda values, i, stage: rides.mount(i, stage),
    "exit_bike": lambda values, i, stage: rides.dismount(i, stage),
    "communicate": _communicate,
    "sit": _posture(Posture.SITTING),
    "stand": _posture(Posture.STANDING),
    "sleep": _posture(Posture.LYING),
    "wake": _posture(Posture.STANDING),
    "drink": _gesture("drink"),
    "eat": _gesture("eat"),
    "wait": _nothing,
    "task_complete": _complete,
}
