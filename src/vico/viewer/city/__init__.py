"""A world for the browser: tiles, textures, models, robots and people, as files of columns."""

from vico.viewer.city.export import city_folder, write_city
from vico.viewer.city.people import PeopleFiles

__all__ = ["PeopleFiles", "city_folder", "write_city"]
