"""The environment, the same for everybody: weather, ground, sun and moon, events of the city, and their effects."""

from vico.sim.environment.agenda import Agenda
from vico.sim.environment.city_events import CityEvent, EventKind, Occurrence, event_kinds
from vico.sim.environment.environment import Conditions, Environment, Sky
from vico.sim.environment.event_sites import EventSites
from vico.sim.environment.weather import CHANGING, Weather, WeatherKind, weather_kinds

__all__ = [
    "CHANGING",
    "Agenda",
    "CityEvent",
    "Conditions",
    "Environment",
    "EventKind",
    "EventSites",
    "Occurrence",
    "Sky",
    "Weather",
    "WeatherKind",
    "event_kinds",
    "weather_kinds",
]
