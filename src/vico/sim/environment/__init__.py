"""What is the same for everybody: weather, ground, sun and moon, events of the city, and what they do."""

from vico.sim.environment.agenda import Agenda
from vico.sim.environment.city_event import CityEvent
from vico.sim.environment.effects import Conditions
from vico.sim.environment.environment import Environment
from vico.sim.environment.event_kinds import EventKind, event_kinds
from vico.sim.environment.event_sites import EventSites
from vico.sim.environment.forecast import CHANGING
from vico.sim.environment.occurrence import Occurrence
from vico.sim.environment.sky import Sky
from vico.sim.environment.weather import Weather, WeatherKind, weather_kinds

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
