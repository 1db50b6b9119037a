"""Forms of English words and names, by rules and their exceptions: articles, participles, first names."""

from __future__ import annotations

import re
from collections.abc import Sequence

__all__ = ["enumerate_words", "participle", "split_name", "uncapitalize", "with_article"]
# Vowels that are spoken as consonants, and the other way round, at the beginning of a word.
_LIKE_YOU = re.compile(r"(?:eu|ewe|one(?!i)|once|u(?:ni(?!n|m)|se|su|ti|ro|k|fo)|ukr)")
_SILENT_H = re.compile(r"(?:hour|honest|honou?r|heir)")
_TITLES = re.compile(r"(?:mr|mrs|ms|miss|mx|dr|prof|professor|doctor|sir|rev|father|sister)\.?", re.IGNORECASE)
# Letters whose names begin with a vowel: an MRI technician, an HR manager, but a UX designer.
_SPOKEN_AS_VOWEL = "AEFHILMNORSX"
# Of longer verbs those stressed at the end double their last letter, and in British spelling those in -l and -p.
_DOUBLED = frozenset([
    "abet", "abhor", "babysit", "acquit", "admit", "allot", "begin", "bedim", "befit", "commit", "compel", "concur",
    "confer", "control", "defer", "demur", "deter", "dispel", "embed", "emit", "equip", "excel", "expel",
    "forget", "forgot", "format", "handicap", "impel", "incur", "infer", "kidnap", "occur", "omit", "outfit",
    "outrun", "overcut", "overrun", "patrol", "permit", "prefer", "propel", "rebut", "recap", "recur", "refer",
    "refit", "regret", "remit", "repel", "repot", "reset", "rerun", "reship", "rewrap", "submit", "transfer",
    "transmit", "unclip", "unpin", "unplug", "unwrap", "unzip", "upset", "worship", "cancel", "channel",
    "counsel", "dial", "duel", "fuel", "label", "level", "marvel", "model", "panel", "pedal", "quarrel", "refuel",
    "shovel", "signal", "swivel", "total", "travel", "tunnel",
])  # fmt: skip
_KEEP_E = frozenset({"singe", "swinge", "tinge"})
_ONE_SYLLABLE = re.compile(r"(?:[^aeiou]*qu|[^aeiouy]*y?)[aeiouy][^aeiouywx]")


def with_article(noun: str) -> str:
    """Put "a" or "an" before a noun, by its sound."""
    first = re.split(r"[\s-]", noun, maxsplit=1)[0]
    # Abbreviations are spelt out, but for long ones that can be spoken as words: a NASA engineer.
    if first.isupper() and first.isalpha() and (len(first) <= 3 or not re.search(r"[AEIOU]", first)):
        an = first[0] in _SPOKEN_AS_VOWEL
    elif first[:1].isdigit():
        an = re.match(r"8|1[18](?!\d)", first) is not None
    else:
        low = first.lower()
        an = bool(_SILENT_H.match(low)) or (low[:1] in "aeiouàáâäåæèéêëìíîïòóôöøùúûü" and not _LIKE_YOU.match(low))
    return f"{'an' if an else 'a'} {noun}"


def enumerate_words(words: Sequence[str]) -> str:
    """Join words, one at least, with commas and a final "and"."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"


def uncapitalize(text: str) -> str:
    """Start in lower case, but leave abbreviations and "I"."""
    return text if re.match(r"[A-Z]{2}|I\b|[A-Z]\d", text) else text[:1].lower() + text[1:]


def split_name(name: str) -> tuple[str, str, str]:
    """Return the title, the first name and the rest of a name: Dr, Jan, van der Berg; titles without their dot."""
    words = name.split()
    title = ""
    while len(words) > 1 and _TITLES.fullmatch(words[0]):
        title = words.pop(0).rstrip(".")
    return title, words[0] if words else name, " ".join(words[1:])


def participle(verb: str) -> str:
    """Return the present participle of a verb: lie, lying; sit, sitting; bake, baking. Compounds turn at their end."""
    head, hyphen, verb = verb.rpartition("-")
    if verb.endswith("ie"):
        turned = f"{verb[:-2]}ying"
    elif verb.endswith("e") and len(verb) > 2 and not verb.endswith(("ee", "oe", "ye")) and verb not in _KEEP_E:
        turned = f"{verb[:-1]}ing"
    elif verb.endswith("ic"):
        turned = f"{verb}king"
    elif verb in _DOUBLED or _ONE_SYLLABLE.fullmatch(verb):
        turned = f"{verb}{verb[-1]}ing"
    else:
        turned = f"{verb}ing"
    return f"{head}{hyphen}{turned}"
