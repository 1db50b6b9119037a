"""A resident who leaves home and a child who goes into school, from 4 m away, by day and by night.

python scripts/doors_sheet.py WORLD COMMUNITY docs/images/doors.jpg [--size 240]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from vico.community import read_community
from vico.render import Cameras
from vico.render.frames import FINE_QUALITY, PictureRequest, take_pictures
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.people.placement import place_in_room
from vico.sim.pictures.scene import SceneRenderer
from vico.world.folder import read_world

HOURS = (10, 22)
# Tenths of a second after the hand went to the door: those that leave, and those that go in.
LEAVING, ENTERING = (6, 9, 12, 16, 20, 27), (2, 6, 10, 14, 18, 24)
AWAY, ASIDE, EYE = 3.6, 1.6, 1.5  # metres


def pictures(sim: Simulation, renderer: SceneRenderer, who: str, place: str, size: int) -> list[NDArray[np.uint8]]:
    """Have somebody go out of a place, or into it if they are outdoors; return what a watcher sees."""
    state = sim.state
    i, index = state.people.names.index(who), state.place_index[place]
    entrance = state.world.places[index].entrance
    assert entrance is not None
    number = state.base.entrance_index[entrance]
    door = state.base.house_doors[number]
    inward = np.array([door["inward_x"], door["inward_y"], 0.0])
    right, sill = np.array([inward[1], -inward[0], 0.0]), np.array([door["x"], door["y"], door["z"]])
    leaves = bool(state.people.room[i] >= 0)
    eye = sill - AWAY * inward + ASIDE * right + np.array([0.0, 0.0, EYE])
    cameras = Cameras(eye[None], (sill + np.array([0.0, 0.0, 1.05]) - eye)[None], width=size, height=size, fov_y=0.9)
    seen: list[NDArray[np.uint8]] = []
    tenths = [-1]

    def look() -> None:
        if tenths[0] >= 0 or (state.people.door[i] >= 0 and state.people.door_time[i] >= 0.0):
            tenths[0] += 1
        if tenths[0] in (LEAVING if leaves else ENTERING):
            scene = renderer.show(state)
            seen.append(
                take_pictures(scene, cameras, PictureRequest(samples=2, quality=FINE_QUALITY), threads=1).rgb[0]
            )

    state.on_substep = look
    action = {"type": "exit"} if leaves else {"type": "enter", "place": place}
    for _ in range(5):
        sim.step({who: action if state.people.door[i] < 0 and tenths[0] < 0 else {"type": "wait"}})
    state.on_substep = None
    return seen


def main() -> None:
    """Draw the sheet."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("world", type=Path)
    parser.add_argument("community", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--size", type=int, default=240)
    asked = parser.parse_args()
    world = read_world(asked.world)
    community = read_community(asked.community, world)
    grown = next(r for r in community.residents if r.age > 25)
    child = next(r for r in community.residents if r.age < 12)
    school = next(item.place for item in child.schedule if item.tag == "study" and item.place)
    count = 1 + max(community.residents.index(one) for one in (grown, child))
    rows = []
    for hour in HOURS:
        sim = Simulation(world, community, SimConfig(residents=count, start=hour * 3600, observe=()))
        renderer = SceneRenderer(sim, detail="full")
        state, names = sim.state, sim.state.people.names
        home = state.indoor.index[state.world.places[state.place_index[grown.home]].rooms[0]]
        door = next(d for d in state.indoor.doors[home] if d.to < 0)
        place_in_room(names.index(grown.id), home, state, near=np.array(door.inside or door.position))
        rows.append(pictures(sim, renderer, grown.id, grown.home, asked.size))
        place = state.world.places[state.place_index[school]]
        sim.scenario.place_agent(child.id, place.position[:2])
        rows.append(pictures(sim, renderer, child.id, school, asked.size))
    sheet = np.concatenate([np.concatenate(row, axis=1) for row in rows])
    Image.fromarray(sheet).save(asked.out, quality=88)


if __name__ == "__main__":
    main()
