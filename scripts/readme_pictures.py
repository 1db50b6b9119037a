"""Make the README's pictures: a lively street, the map, what a resident sees.

python scripts/readme_pictures.py out/demo docs/images
"""

import argparse
from pathlib import Path

import numpy as np
from PIL import Image

from vico.agents.schedule import followers_of
from vico.community import read_community
from vico.render import Cameras
from vico.render.film import read_film
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.sim.pictures.scene import SceneRenderer
from vico.world.folder import read_world
from vico.world.public import PublicMap
from vico.worldgen.previews import viewpoints

WIDTH, HEIGHT = 1280, 640


def main() -> None:
    """Simulate a crowded morning for a few minutes and photograph it where most is going on."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("demo", type=Path, help="folder of a demo")
    parser.add_argument("out", type=Path)
    parser.add_argument("--steps", type=int, default=240)
    parser.add_argument("--pick", type=int, default=0, help="which of the liveliest street views, from 0")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)

    world = read_world(arguments.demo / "world")
    community = read_community(arguments.demo / "community", world)
    config = SimConfig(seed=0, cars=70, pedestrians=400, robots=("husky", "go2"), errands=True, observe=())
    sim = Simulation(world, community, config)
    followers = followers_of(community, PublicMap.from_world(world), seed=0)
    observations, infos = sim.observe()
    for _ in range(arguments.steps):
        result = sim.step({name: agent.act(observations[name], infos[name]) for name, agent in followers.items()})
        observations, infos = result.observations, result.infos

    views = viewpoints(world, count=120)
    bodies = sim.state.obstacles()
    order = sorted(views, key=lambda view: -liveliness(view, bodies))
    renderer = SceneRenderer(sim)
    view = order[arguments.pick]
    camera = Cameras(
        np.array([view.position]), np.array([view.forward]), fov_y=np.radians(50.0), width=WIDTH, height=HEIGHT
    )
    picture = Image.fromarray(renderer.render_cameras(sim.state, camera, samples=3)[0])
    picture.save(arguments.out / "street.png", optimize=True)

    plan = Image.open(arguments.demo / "world" / "map.png").convert("RGB")
    plan.thumbnail((900, 900))
    plan.save(arguments.out / "map.png", optimize=True)
    films = sorted((arguments.demo / "run" / "views" / "resident_2").glob("*.mp4"))
    seen = next(read_film(films[0], wanted={240}))
    Image.fromarray(seen).resize((512, 512), Image.Resampling.BICUBIC).save(arguments.out / "first_person.png")


def liveliness(view, bodies) -> float:
    """How much is going on before a camera: people and vehicles near its axis, nearer ones more."""
    gap = bodies.position[:, :2] - np.asarray(view.position)[:2]
    ahead = np.asarray(view.forward)[:2] / np.linalg.norm(np.asarray(view.forward)[:2])
    along = gap @ ahead
    aside = np.abs(gap @ np.array([-ahead[1], ahead[0]]))
    seen = (along > 4.0) & (along < 60.0) & (aside < 0.75 * along)
    return float((1.0 / (1.0 + (along[seen] / 9.0) ** 2)).sum())


if __name__ == "__main__":
    main()
