"""Which model a mapped thing has: OpenStreetMap's tags to the names of prototypes."""

from __future__ import annotations

import re

import numpy as np

from vico.geo.frame import LocalFrame
from vico.geo.osm import Tags
from vico.worldgen.objects.wishes import number

_AMENITIES = {
    "bench": "bench", "waste_basket": "waste_basket", "waste_disposal": "bins", "recycling": "recycling",
    "bicycle_parking": "bicycle_parking", "fountain": "fountain", "post_box": "post_box", "telephone": "telephone",
    "vending_machine": "vending_machine", "atm": "atm", "drinking_water": "drinking_water",
    "water_point": "water_pump", "watering_place": "fountain_trough", "clock": "clock", "shelter": "shelter",
    "charging_station": "charging_station", "parcel_locker": "parcel_locker", "binoculars": "binoculars",
    "grit_bin": "grit_bin", "toilets": "toilets", "luggage_locker": "luggage_locker", "ashtray": "waste_basket",
    "lounger": "lounger", "kiosk": "kiosk", "motorcycle_parking": "motorcycles", "taxi": "sign_taxi",
    "car_sharing": "sign_parking", "bbq": "bbq", "public_bookcase": "public_bookcase", "give_box": "public_bookcase",
    "photo_booth": "vending_machine", "ticket_validator": "parking_meter", "compressed_air": "parking_meter",
    "bicycle_repair_station": "parking_meter", "defibrillator": "defibrillator", "tent": "tent", "fuel": "fuel_pump",
    "artwork": "sculpture", "payment_terminal": "atm", "dog_toilet": "dog_bin", "market_stall": "market_stall",
    "table": "picnic_table", "game_table": "chess_table", "parking_meter": "parking_meter",
}  # fmt: skip
_BY_KEY: dict[str, dict[str, str]] = {
    "amenity": _AMENITIES,
    "highway": {"street_lamp": "street_lamp", "traffic_signals": "traffic_signals", "speed_camera": "speed_camera",
                "stop": "sign_stop", "give_way": "sign_give_way", "traffic_mirror": "traffic_mirror",
                "elevator": "elevator", "milestone": "boundary_stone", "emergency_access_point": "sign_guide",
                "toll_gantry": "mast"},
    "emergency": {"fire_hydrant": "fire_hydrant", "phone": "telephone", "drinking_water": "drinking_water",
                  "life_ring": "life_ring", "defibrillator": "defibrillator", "siren": "mast"},
    "barrier": {"bollard": "bollard", "block": "block", "lift_gate": "lift_gate", "planter": "planter",
                "swing_gate": "swing_gate", "gate": "gate", "kissing_gate": "gate", "turnstile": "turnstile",
                "full-height_turnstile": "turnstile", "cycle_barrier": "cycle_barrier", "chain": "chain",
                "jersey_barrier": "jersey_barrier", "toll_booth": "kiosk", "motorcycle_barrier": "cycle_barrier",
                "hampshire_gate": "gate", "bump_gate": "swing_gate", "guard_rail": "guard_rail"},
    "advertising": {"column": "advertising_column", "billboard": "billboard", "poster_box": "poster_box",
                    "board": "billboard", "screen": "poster_box", "sign": "sign", "totem": "poster_box",
                    "flag": "flagpole", "tarp": "billboard"},
    "man_made": {"flagpole": "flagpole", "utility_pole": "utility_pole", "mast": "mast", "obelisk": "obelisk",
                 "street_cabinet": "street_cabinet", "water_well": "water_pump", "water_tap": "drinking_water",
                 "support_pillar": "pillar", "planter": "planter", "surveillance": "surveillance", "antenna": "mast",
                 "cross": "wayside_cross", "advertising": "poster_box", "monitoring_station": "street_cabinet",
                 "communications_tower": "mast", "insect_hotel": "public_bookcase", "column": "pillar",
                 "bollard": "bollard", "pump": "water_pump", "lamp": "park_lamp", "survey_point": ""},
    "power": {"cable_distribution_cabinet": "street_cabinet", "pole": "utility_pole", "tower": "power_tower",
              "catenary_mast": "catenary_mast", "transformer": "street_cabinet"},
    "telecom": {"connection_point": "street_cabinet", "distribution_point": "street_cabinet",
                "service_device": "street_cabinet"},
    "street_cabinet": {"": "street_cabinet"},
    "historic": {"memorial": "memorial", "monument": "statue", "milestone": "boundary_stone", "tomb": "tomb",
                 "boundary_stone": "boundary_stone", "wayside_cross": "wayside_cross",
                 "wayside_shrine": "wayside_cross", "statue": "statue", "stone": "boundary_stone"},
    "tourism": {"artwork": "sculpture", "information": "information", "picnic_site": "picnic_table",
                "camp_pitch": "tent_small"},
    "leisure": {"picnic_table": "picnic_table", "playground": "play_tower", "outdoor_seating": "cafe_parasol",
                "table_tennis_table": "table_tennis", "fitness_station": "fitness_station", "firepit": "bbq"},
    "natural": {"shrub": "shrub", "stone": "stone", "rock": "rock", "boulder": "rock", "tree_stump": "stump"},
    "railway": {"subway_entrance": "subway_entrance", "buffer_stop": "buffer_stop", "signal": "railway_signal"},
    "building": {"kiosk": "kiosk", "tent": "tent"},
    "shop": {"kiosk": "kiosk"},
    "playground": {"slide": "slide", "swing": "swing", "basketswing": "swing_nest", "springy": "springy",
                   "climbingframe": "climbing_frame", "climbing": "climbing_frame", "structure": "play_tower",
                   "seesaw": "seesaw", "sandpit": "sandpit", "roundabout": "roundabout", "playhouse": "play_tower",
                   "pingpongtable": "table_tennis", "table_tennis_table": "table_tennis",
                   "basketrotator": "roundabout", "balancebeam": "bench_flat", "exercise": "fitness_station",
                   "hopscotch": ""},
}  # fmt: skip
_FLAT_ART = ("mural", "graffiti", "mosaic", "relief", "painting", "tilework", "street_art", "stencil")
_ART = {"statue": "statue", "bust": "bust", "stone": "boundary_stone", "fountain": "fountain_wall",
        "installation": "sculpture_blocks", "architecture": "sculpture_blocks"}  # fmt: skip
_MEMORIALS = {"statue": "statue", "sculpture": "sculpture", "bust": "bust", "cross": "wayside_cross",
              "stone": "boundary_stone", "stele": "memorial", "obelisk": "obelisk", "column": "column",
              "bench": "bench", "grave": "tomb", "khachkar": "boundary_stone"}  # fmt: skip
_ON_WALLS = ("plaque", "blue_plaque", "stolperstein", "plate", "ghost_bike")
_ON_BUILDINGS = ("wall", "building", "ceiling", "roof", "wall_mounted", "tree", "catenary", "suspended")

#: Where OSM says nothing better: signs by the number of a country's code; the longest beginning that fits counts.
_CODES: dict[str, dict[str, str]] = {
    "FI": {"1": "sign_warning", "2": "sign_guide", "231": "sign_give_way", "232": "sign_stop", "3": "sign_ban",
           "331": "sign_no_entry", "36": "sign_speed", "37": "sign_no_stopping", "4": "sign_mandatory",
           "511": "sign_crossing", "52": "sign_parking", "53": "", "533": "sign_taxi", "534": "sign_taxi",
           "54": "sign_guide", "55": "sign_parking", "5": "sign_parking", "6": "sign_guide", "7": "sign_guide",
           "8": ""},
    "DE": {"1": "sign_warning", "10": "", "205": "sign_give_way", "206": "sign_stop", "2": "sign_ban",
           "20": "sign_mandatory", "21": "sign_mandatory", "22": "sign_mandatory", "224": "", "23": "sign_mandatory",
           "24": "sign_mandatory", "267": "sign_no_entry", "274": "sign_speed", "28": "sign_no_stopping",
           "29": "sign_no_stopping", "3": "sign_guide", "314": "sign_parking", "315": "sign_parking",
           "350": "sign_crossing", "4": "sign_guide", "101": "sign_warning", "102": "sign_warning",
           "103": "sign_warning", "105": "sign_warning", "108": "sign_warning"},
    "US": {"R1-1": "sign_stop", "R1-2": "sign_give_way", "R5": "sign_no_entry", "R7": "sign_parking",
           "R": "sign_guide", "W": "sign_warning", "D3": "sign_street", "D": "sign_guide", "S": "sign_warning"},
    "GB": {"601": "sign_stop", "602": "sign_give_way", "616": "sign_no_entry", "670": "sign_speed", "6": "sign_ban",
           "5": "sign_warning", "8": "sign_parking", "9": "sign_mandatory"},
    "FR": {"A": "sign_warning", "AB3": "sign_give_way", "AB4": "sign_stop", "B1": "sign_no_entry",
           "B14": "sign_speed", "B6": "sign_no_stopping", "B": "sign_ban", "B2": "sign_mandatory",
           "C1": "sign_parking", "C20": "sign_crossing", "C": "sign_parking"},
    "SE": {"A": "sign_warning", "B1": "sign_give_way", "B2": "sign_stop", "B3": "sign_crossing", "B": "sign_guide",
           "C1": "sign_no_entry", "C31": "sign_speed", "C35": "sign_no_stopping", "C": "sign_ban",
           "D": "sign_mandatory", "E19": "sign_parking", "E": "sign_guide"},
}  # fmt: skip
_CODES["AT"] = _CODES["CH"] = _CODES["DE"]
_WORDS = {"stop": "sign_stop", "give_way": "sign_give_way", "yield": "sign_give_way", "maxspeed": "sign_speed",
          "hazard": "sign_warning", "city_limit": "sign_guide", "overtaking": "sign_ban", "maxweight": "sign_ban",
          "maxheight": "sign_ban", "no_entry": "sign_no_entry", "parking": "sign_parking",
          "no_parking": "sign_no_stopping", "no_stopping": "sign_no_stopping", "crossing": "sign_crossing",
          "street": "sign_street", "variable_message": "sign_guide"}  # fmt: skip


def region(frame: LocalFrame) -> str:
    """Where the look of post boxes differs: ``uk``, ``us`` or ``""``."""
    if 49.8 < frame.lat < 61.0 and -11.0 < frame.lon < 1.9:
        return "uk"
    return "us" if frame.lon < -60.0 and 24.0 < frame.lat < 50.0 else ""


def sign_of(code: str) -> str | None:
    """Model of a sign by its `traffic_sign` code (``FI:361[30]``, ``US:R1-1``, ``stop``); None if it is none."""
    first = re.split(r"[;,]", code)[0].strip()
    if first in _WORDS:
        return _WORDS[first]
    found = re.match(r"([A-Z]{2}):\s*([A-Z]*\d*(?:-\d+)?)", first)
    table = _CODES.get(found.group(1)) if found else None
    if found is None or table is None:
        return None
    mark = found.group(2)
    for length in range(len(mark), 0, -1):
        if mark[:length] in table:
            return table[mark[:length]] or None
    return None


def on_the_ground(tags: Tags) -> bool:
    """Whether a thing stands outdoors at street level."""
    if tags.get("location") in ("underground", "indoor", "wall", "roof", "rooftop"):
        return False
    if tags.get("indoor", "no") not in ("no", "outdoor") or tags.get("tunnel", "no") not in ("no",):
        return False
    levels = [number(part) for part in tags.get("level", "").split(";")]
    known = [level for level in levels if level is not None]
    return not known or 0.0 in known


def thing_of(tags: Tags, *, where: str = "", random: np.random.Generator | None = None) -> str | None:
    """Name of the model for a mapped thing.

    Parameters
    ----------
    tags
        Its tags.
    where
        As `region` says.
    random
        Picks among models that suit equally well; the first without.

    Returns
    -------
    str or None
        None if it is nothing that stands in streets.
    """
    if not on_the_ground(tags) or tags.get("fire_hydrant:type") in ("underground", "wall", "pipe"):
        return None
    found = None
    for key, values in _BY_KEY.items():
        value = tags.get(key)
        if value is None:
            continue
        found = values.get(value, values.get("")) or None
        if found is not None:
            break
    if found is None:
        return sign_of(tags["traffic_sign"]) if "traffic_sign" in tags else None
    rule = _DETAILS.get(found)
    return found if rule is None else rule(tags, where, random)


def _one(random: np.random.Generator | None, *names: str) -> str:
    return names[0] if random is None else names[int(random.integers(len(names)))]


def _bench(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    if tags.get("backrest") == "no":
        stone = tags.get("material") in ("stone", "concrete", "granite", "marble", "brick")
        return "bench_stone" if stone else "bench_flat"
    return "bench"


def _basket(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    return "dog_bin" if "excrement" in tags.get("waste", "") + tags.get("vending", "") else "waste_basket"


def _bins(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    return _one(random, "waste_container", "bins")


def _recycling(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    taken = [key for key, value in tags.items() if key.startswith("recycling:") and value == "yes"]
    return "recycling_glass" if taken and all("glass" in key for key in taken) else "recycling"


def _post_box(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    if tags.get("post_box:type") == "wall" or tags.get("support") == "wall":
        return None
    if tags.get("post_box:type") == "pillar" or where == "uk":
        return "post_box_pillar"
    return "post_box_blue" if where == "us" else "post_box"


def _bicycles(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    room = number(tags.get("capacity"))
    if room is None:
        return _one(random, "bicycle_parking", "bicycle_parking_empty", "bicycle_parking_small")
    if room <= 2:
        return "bicycle_stand"
    if room <= 5:
        return "bicycle_parking_small"
    return "bicycle_parking_large" if room > 10 else _one(random, "bicycle_parking", "bicycle_parking_empty")


def _lamp(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    if tags.get("lamp_mount", tags.get("support", "")).split(";")[0] in _ON_BUILDINGS:
        return None
    if tags.get("lamp_type") == "gaslight" or tags.get("lamp_model:de", "").startswith("Gas"):
        return "lantern"
    tall = number(tags.get("height"))
    if tall is not None and tall < 1.6:
        return "lamp_low"
    if tall is not None and tall < 4.8:
        return "park_lamp"
    many = number(tags.get("light:count", tags.get("lamp:count"))) or 1
    return "street_lamp_double" if many >= 2 else "street_lamp"


def _art(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    kind = tags.get("artwork_type", "")
    if kind in _FLAT_ART:
        return None
    return _ART.get(kind) or _one(random, "sculpture", "sculpture_blocks")


def _memorial(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    kind = tags.get("memorial", "")
    if kind in _ON_WALLS or tags.get("support") in _ON_BUILDINGS:
        return None
    return _MEMORIALS.get(kind, "memorial")


def _monument(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    return _MEMORIALS.get(tags.get("monument", tags.get("memorial", "")), "statue")


def _machine(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    sold = tags.get("vending", "")
    if "parcel" in sold:
        return "parcel_locker"
    if "excrement" in sold:
        return "dog_bin"
    if sold in ("parking_tickets", "public_transport_tickets"):
        return "parking_meter"
    return None if tags.get("support") in _ON_BUILDINGS else "vending_machine"


def _camera(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    return None if tags.get("camera:mount", "").split(";")[0] in _ON_BUILDINGS else "surveillance"


def _fountain(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    if tags.get("drinking_water") == "yes" or tags.get("fountain") in ("drinking", "bottle_refill"):
        return "fountain_trough"
    return _one(random, "fountain", "fountain_jets")


def _board(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    kind = tags.get("information", "")
    if kind in ("office", "visitor_centre", "audioguide", "tactile_model"):
        return None
    return "sign_guide" if kind in ("guidepost", "route_marker") else "information"


def _pole(tags: Tags, where: str, random: np.random.Generator | None) -> str:
    """Poles in towns, which hold lamps and tram wires, are of steel; those of power and telephone lines of wood."""
    lines = ("power", "telecom") if "man_made" in tags else ("",)
    wooden = tags.get("material", "wood" if "power" in tags else "") == "wood"
    return "utility_pole" if wooden or tags.get("utility", "-") in lines else "pole_steel"


def _clock(tags: Tags, where: str, random: np.random.Generator | None) -> str | None:
    return None if tags.get("support") in ("wall", "wall_mounted", "building", "roof", "tower") else "clock"


_DETAILS = {
    "bench": _bench, "waste_basket": _basket, "bins": _bins, "recycling": _recycling, "post_box": _post_box,
    "bicycle_parking": _bicycles, "street_lamp": _lamp, "sculpture": _art, "memorial": _memorial,
    "statue": _monument, "vending_machine": _machine, "surveillance": _camera, "fountain": _fountain,
    "information": _board, "clock": _clock, "utility_pole": _pole,
}  # fmt: skip
