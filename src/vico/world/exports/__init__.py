"""A world in other people's formats: glTF, OpenUSD, MuJoCo's MJCF, GeoJSON, OpenDRIVE."""

from vico.world.exports.formats import EXPORT_FOLDER, FORMATS, export_city, export_world

__all__ = ["EXPORT_FOLDER", "FORMATS", "export_city", "export_world"]
