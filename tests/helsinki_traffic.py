"""Traffic on the streets of central Helsinki, by each rule for junctions."""

from functools import cache

from road_city import HALF, road_city
from vico.sim.traffic import JunctionRule, Traffic, TrafficNetwork, TrafficSetup
from vico.world.heights import HeightField


@cache
def network() -> TrafficNetwork:
    """What traffic moves on."""
    city = road_city()
    return TrafficNetwork.of(city.lanes, city.solids)


def traffic_by(rule: JunctionRule, cars: int = 60, pedestrians: int = 0) -> Traffic:
    """Traffic by a rule."""
    return Traffic(
        network(),
        HeightField.flat(HALF),
        cars=cars,
        pedestrians=pedestrians,
        seed=1,
        first_entity=1_000_000,
        setup=TrafficSetup(rule),
    )
