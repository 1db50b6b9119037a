"""A world in other people's formats: glTF, OpenUSD, MuJoCo's MJCF, GeoJSON, OpenDRIVE."""

from vico.world.exports.formats import FORMATS, export_city, export_world

__all__ = ["FORMATS", "export_city", "export_world"]
