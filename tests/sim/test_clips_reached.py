"""Every motion of the library is reached: by an action of an agent or by a rule."""

from __future__ import annotations

from typing import Any

import numpy as np

import toy_city
from vico.assets.shapes import box
from vico.sim.animation import CLIPS
from vico.sim.bodies.state_arrays import Posture
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.people import pedestrian_motion
from vico.sim.traffic.drawing import PedestrianGaits
from vico.sim.traffic.state import STOP
from vico.world.world import World


class _Watched:
    """A simulation, and which motions its first avatar made in any sub-step."""

    def __init__(self, sim: Simulation) -> None:
        self.sim, self.seen = sim, set[str]()
        sim.state.on_substep = self._note

    def _note(self) -> None:
        self.seen.add(CLIPS[self.sim.state.people.clip[0]])

    def act(self, **action: Any) -> str:
        """Let the first avatar act; return how it went."""
        state = self.sim.step({"assistant_0": action}).observations["assistant_0"]["state"]
        return str(state["action_status"])


def in_the_street() -> set[str]:
    """Walk, run, turn, carry, talk, wave, sit, go through a door, lie."""
    sim = Simulation(toy_city.world(), None, SimConfig(assistants=2, observe=()))
    watched = _Watched(sim)
    sim.scenario.place_agent("assistant_0", (-20.0, -15.0))
    sim.scenario.place_agent("assistant_1", (-15.0, -20.0))
    size = (0.1, 0.1, 0.2)
    things = [
        sim.scenario.add_object(f"bag {k}", "bag", [box(size, (0, 0, 0.1))], np.array([-19.5, -14.5 - k, 0]), size=size)
        for k in range(2)
    ]
    watched.act(type="wait")
    watched.act(type="communicate", text="Hello over there!")
    for hand, thing in enumerate(things):
        assert watched.act(type="pick", hand=hand, object=thing) == "ok"
    watched.act(type="turn_right", degrees=90.0)
    watched.act(type="move_forward", distance=1.0)
    for hand in (1, 0):
        assert watched.act(type="put", hand=hand) == "ok"
        watched.act(type="move_forward", distance=0.5)
        watched.act(type="turn_left", degrees=180.0)
        watched.act(type="move_forward", distance=0.5)
    assert watched.act(type="pick", hand=1, object=things[1]) == "ok"
    watched.act(type="move_forward", distance=0.5)
    sim.scenario.place_agent("assistant_1", sim.state.people.position[0] + np.array([1.0, 0.0, 0.0]))
    watched.act(type="communicate", text="Hello!")
    watched.act(type="wait")
    assert watched.act(type="hand_over", hand=1, agent="assistant_1") == "ok"
    watched.act(type="move_forward", distance=2.5)
    for kind in ("drink", "eat"):
        watched.act(type=kind)
    sim.state.people.posture[0] = Posture.SITTING
    for kind in ("drink", "eat", "wait", "wait"):
        watched.act(type=kind)
    watched.act(type="communicate", text="Hello from my chair!")
    sim.scenario.place_agent("assistant_1", (-15.0, -20.0))
    watched.act(type="communicate", text="Hello over there!")
    sim.state.people.posture[0] = Posture.STANDING
    sim.scenario.place_agent("assistant_0", (-5.0, 3.6))
    for _ in range(2):
        assert watched.act(type="enter", place=toy_city.CAFE) == "ok"
    for _ in range(2):
        watched.act(type="wait")
    sim.state.people.posture[0] = Posture.LYING
    watched.act(type="sleep")
    return watched.seen


def in_vehicles(city: World) -> set[str]:
    """Ride a bus, seated and standing, and a bicycle."""
    sim = Simulation(city, None, SimConfig(assistants=1, observe=()))
    watched, transit = _Watched(sim), sim.state.transit
    assert transit is not None
    people = sim.state.people
    people.cash[0] = 50.0
    bus = next(b for b in range(transit.traffic.buses) if transit.stopped_at(b) is not None)
    sim.scenario.place_agent("assistant_0", transit.exit_spots(bus)[0])
    assert watched.act(type="enter_bus") == "ok"
    watched.act(type="wait")
    # As those do who find no seat.
    people.posture[0] = Posture.STANDING
    watched.act(type="wait")
    if watched.act(type="exit_bus") != "ok":
        for _ in range(600):
            if watched.act(type="exit_bus") == "ok":
                break
    for bike in range(len(transit.bicycles.xy)):
        sim.scenario.place_agent("assistant_0", transit.bicycles.xy[bike])
        if watched.act(type="enter_bike") == "ok":
            break
    watched.act(type="move_forward", distance=2.0)
    watched.act(type="exit_bike")
    return watched.seen


def at_a_stop() -> set[str]:
    """Wait for a bus, as a pedestrian."""
    no, yes = np.zeros(2, np.bool_), np.ones(2, np.bool_)
    waits = PedestrianGaits(np.ones(2), np.zeros(2), np.full(2, -9.0), np.full(2, STOP, np.uint8), no, no, yes)
    shown = [pedestrian_motion(waits, np.full(2, 1.7), float(second)).clip[1] for second in range(60)]
    return {CLIPS[clip] for clip in shown}


def test_every_motion_is_reached(helsinki_city: World) -> None:
    assert set(CLIPS) - in_the_street() - in_vehicles(helsinki_city) - at_a_stop() == set()
