"""Who lives in a world: residents, groups, schedules, and the validator that keeps them grounded."""

from vico.community.author import Author, build_community, procedural_author
from vico.community.folder import digest_of, read_community, read_manifest, world_of, write_community
from vico.community.model import (
    Appearance,
    Community,
    CommunityManifest,
    Group,
    ItemType,
    Personality,
    Relation,
    RelationKind,
    Resident,
    ScheduleItem,
    clock_of,
    seconds_of,
)
from vico.community.validator import Finding, check_community

__all__ = [
    "Appearance",
    "Author",
    "Community",
    "CommunityManifest",
    "Finding",
    "Group",
    "ItemType",
    "Personality",
    "Relation",
    "RelationKind",
    "Resident",
    "ScheduleItem",
    "build_community",
    "check_community",
    "clock_of",
    "digest_of",
    "procedural_author",
    "read_community",
    "read_manifest",
    "seconds_of",
    "world_of",
    "write_community",
]
