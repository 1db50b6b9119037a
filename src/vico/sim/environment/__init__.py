"""What is the same for everybody outdoors: weather, ground, sun and moon, and what they do to those who are there."""

from vico.sim.environment.effects import Conditions
from vico.sim.environment.environment import Environment
from vico.sim.environment.forecast import CHANGING
from vico.sim.environment.sky import Sky
from vico.sim.environment.weather import Weather, WeatherKind, weather_kinds

__all__ = ["CHANGING", "Conditions", "Environment", "Sky", "Weather", "WeatherKind", "weather_kinds"]
