"""The people of a world: residents, groups, schedules, and the validator that keeps them grounded."""

from vico.community.author import Author, build_community, procedural_author
from vico.community.folder import digest_of, read_community, read_manifest, read_names, world_of, write_community
from vico.community.model import (
    ActivityTag,
    Community,
    CommunityDay,
    CommunityFinding,
    CommunityManifest,
    Group,
    ItemType,
    Mode,
    Personality,
    Relation,
    RelationKind,
    Resident,
    ResidentAppearance,
    ScheduleItem,
    with_tags,
)
from vico.community.schedules import date_of
from vico.community.validator import check_community

__all__ = [
    "ActivityTag",
    "Author",
    "Community",
    "CommunityDay",
    "CommunityFinding",
    "CommunityManifest",
    "Group",
    "ItemType",
    "Mode",
    "Personality",
    "Relation",
    "RelationKind",
    "Resident",
    "ResidentAppearance",
    "ScheduleItem",
    "build_community",
    "check_community",
    "date_of",
    "digest_of",
    "procedural_author",
    "read_community",
    "read_manifest",
    "read_names",
    "with_tags",
    "world_of",
    "write_community",
]
