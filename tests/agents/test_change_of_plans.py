"""Residents' plans in bad weather, on slippery ground, and when something is on, beside the same day without."""

from __future__ import annotations

import numpy as np
import pytest

import toy_city
from vico.agents.day_plan import DayPlanChanges, WeatherTolerance, stays_of
from vico.agents.schedule import followers_of
from vico.agents.travel import Traveller
from vico.seeds import rng
from vico.sim.config import SimConfig
from vico.sim.loop.simulation import Simulation
from vico.world.public import PublicMap
from vico.world.world import World

ME = "resident_2"
FAIR = {"rain": 0.0, "snow": 0.0, "wind": 3.0, "temperature": 18.0, "wet": 0.0, "snow_cover": 0.0, "ice": 0.0}
DOWNPOUR = FAIR | {"rain": 20.0, "wet": 1.0}
#: In the toy city's open ground, off the house.
HERE = [20.0, -20.0, 15.0]


def day(weather: str) -> Simulation:
    """Let the resident who has the day off for the park live three minutes of it; nobody else is at leisure."""
    community = toy_city.community()
    resident = community.residents[2]
    resident = resident.model_copy(
        update={"schedule": [*resident.schedule[:-1], resident.schedule[-1].model_copy(update={"tag": "leisure"})]}
    )
    community = community.model_copy(update={"residents": [*community.residents[:2], resident]})
    config = SimConfig(seed=2, start=8 * 3600 - 40, observe=(), weather=weather)
    sim = Simulation(toy_city.world(), community, config)
    followers = followers_of(community, PublicMap.from_world(sim.world), seed=config.seed)
    observations, infos = sim.observe()
    for _ in range(200):
        result = sim.step({name: one.act(observations[name], infos[name]) for name, one in followers.items()})
        observations, infos = result.observations, result.infos
    # What is remembered goes on in another follower as in this one.
    again = followers_of(community, PublicMap.from_world(sim.world), seed=config.seed)[ME]
    again.restore(followers[ME].state())
    assert repr(again.state()) == repr(followers[ME].state())
    return sim


def test_who_wanted_to_the_park_goes_there_by_fair_weather_and_stays_in_when_it_pours() -> None:
    for weather, place in (("fair", ""), ("downpour", toy_city.CAFE)):
        assert day(weather).observe()[0][ME]["state"]["place"] == place


def test_some_of_those_at_leisure_go_to_a_concert_and_look_at_the_stage() -> None:
    public = PublicMap.from_world(toy_city.world())
    stays = stays_of(toy_city.community().residents[2].schedule, public.place_by_id)
    stay = next(stay for stay in stays if stay.place == toy_city.PARK)
    stay = type(stay)(stay.leave, stay.due, stay.type, "leisure", stay.activity, stay.place)
    event = {"id": 1, "kind": "concert", "name": "a concert", "goes_on": True, "closed_places": []}
    info = {"weather": FAIR, "events": [event | {"position": [20.0, -20.0, 0.0]}]}
    plans = [DayPlanChanges(public, [stay], seed=seed, name=ME) for seed in range(40)]
    there = [plan.place_of(stay, info, "") for plan in plans]
    comes = [plan.point_to_watch(place) is not None for plan, place in zip(plans, there, strict=True)]
    assert 8 <= sum(comes) <= 24
    away = [np.hypot(*(np.array(place.position[:2]) - HERE[:2])) for place in there]
    assert all((distance <= 14.0) == here for distance, here in zip(away, comes, strict=True))
    # In the rain those who mind it don't, and afterwards nobody is there.
    wet = info | {"weather": DOWNPOUR}
    assert not any(plan.point_to_watch(plan.place_of(stay, wet, "")) for plan in plans)
    over = {"weather": FAIR, "events": [info["events"][0] | {"goes_on": False}]}
    assert {plan.place_of(stay, over, "").id for plan in plans[:1]} <= {toy_city.PARK, toy_city.CAFE}


def test_on_snow_and_ice_one_sets_out_earlier_and_leaves_the_bicycle() -> None:
    public = PublicMap.from_world(toy_city.world())
    stays = stays_of(toy_city.community().residents[0].schedule, public.place_by_id)
    plan = DayPlanChanges(public, stays, seed=0, name=ME)
    way = stays[-1]
    for weather, earlier, avoided in (
        (FAIR, 0.0, ()),
        (FAIR | {"snow_cover": 1.0}, 120 * (1 / 0.88 - 1), ("bike",)),
        (FAIR | {"ice": 1.0}, 40.0, ("bike",)),
    ):
        plan.notice({"weather": weather})
        assert way.leave - plan.departures[-1] == pytest.approx(earlier)
        assert plan.avoided_modes == avoided
        assert list(plan.changes()) == sorted(plan.departures)


def test_people_differ_in_how_much_rain_they_stand() -> None:
    limits = [WeatherTolerance.of(0, f"resident_{k}").rain for k in range(100)]
    assert 0.5 <= min(limits) < 1.5
    assert 5.0 < max(limits) <= 6.0
    drizzle = FAIR | {"rain": 0.4}
    assert not any(WeatherTolerance.of(0, f"resident_{k}").is_exceeded(drizzle) for k in range(100))
    assert all(WeatherTolerance.of(0, f"resident_{k}").is_exceeded(DOWNPOUR) for k in range(100))


def test_a_trip_is_planned_without_the_modes_one_avoids(helsinki_city: World) -> None:
    public = PublicMap.from_world(helsinki_city)
    here, there = (station.position[:2] for station in (public.bike_stations[0], public.bike_stations[-1]))
    observation = {
        "pose": np.array([*here, 0.0, 1.0, 0.0, 0.0]),
        "state": {"vehicle": "", "time": 9 * 3600.0, "cash": 50.0, "action_status": "ok", "action_code": "none"},
    }
    modes = []
    for without in ((), ("bike",)):
        traveller = Traveller(public, rng(0, "travel"), modes=("walk", "bike"))
        traveller.towards(there, observation, {}, without=without)
        assert traveller.trip is not None
        modes.append({leg.mode for leg in traveller.trip.legs})
    assert modes == [{"walk", "bike"}, {"walk"}]
