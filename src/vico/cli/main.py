"""The `vico` command: one verb a capability, how its words become values, and what is said of those that cannot.

Exit codes: 0 done, 1 found wanting (a check failed), 2 bad input or a fault of the program (one sentence on stderr;
the traceback of a fault shows with `vico --verbose VERB`). Results go to stdout, progress and warnings to stderr;
`vico --verbose VERB` tells more there, `vico --quiet VERB` less. Each verb imports what it needs when it runs, so
`vico --help` is quick.
"""

from __future__ import annotations

import difflib
import errno
import gc
import io
import logging
import os
import sys
import types
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, NoReturn, Union, get_args

import tyro
from tyro.constructors import ConstructorRegistry, PrimitiveConstructorSpec, PrimitiveTypeInfo
from tyro.extras import SubcommandApp

from vico.cli.assets import assets, language_model, motion
from vico.cli.check_agent import check_agent
from vico.cli.city import city
from vico.cli.community import check_community, community
from vico.cli.console import ended_by_signals, exit_code
from vico.cli.dataset import dataset
from vico.cli.demo import bench, demo, warm_up
from vico.cli.doctor import doctor
from vico.cli.evaluation import evaluation
from vico.cli.film import film, replay, score_pictures, still
from vico.cli.leaderboard import leaderboard
from vico.cli.options import FLAT, RunOptions, with_ray_address
from vico.cli.viewer import live, play, view
from vico.cli.world import check_world, export, world
from vico.errors import InputError, VicoError, line_of, sentence_of
from vico.io.files import reason_of
from vico.version import __version__

#: Reads numbers with our own words for what is none, and options that may be left out without "None" in their help.
REGISTRY = ConstructorRegistry()
_LEFT_OUT = "unset"


@REGISTRY.primitive_rule
def _numbers(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    if info.type not in (int, float):
        return None
    kind, words, example = (int, "whole number", "300") if info.type is int else (float, "number", "0.5")

    def read(given: list[str]) -> int | float:
        try:
            return kind(given[0])
        except ValueError:
            raise ValueError(f"{given[0]!r} is no {words}; give one such as {example}") from None

    return PrimitiveConstructorSpec(
        nargs=1,
        metavar=kind.__name__.upper(),
        instance_from_str=read,
        is_instance=lambda value: isinstance(value, kind) or (kind is float and isinstance(value, int)),
        str_from_instance=lambda value: [str(value)],
    )


@REGISTRY.primitive_rule
def _optional(info: PrimitiveTypeInfo) -> PrimitiveConstructorSpec[Any] | None:
    kinds = get_args(info.type)
    if info.type_origin not in (Union, types.UnionType) or len(kinds) != 2 or type(None) not in kinds:
        return None
    inner = next(kind for kind in kinds if kind is not type(None))
    spec = ConstructorRegistry.get_primitive_spec(PrimitiveTypeInfo.make(inner, info.markers))
    if not isinstance(spec, PrimitiveConstructorSpec):
        return None
    return PrimitiveConstructorSpec(
        nargs=spec.nargs,
        metavar=spec.metavar,
        instance_from_str=spec.instance_from_str,
        is_instance=lambda value: True if value is None else spec.is_instance(value),
        str_from_instance=lambda value: [_LEFT_OUT] if value is None else spec.str_from_instance(value),
        choices=spec.choices,
    )


def check_verb(given: Sequence[str], verbs: Mapping[str, Sequence[str]]) -> None:
    """Make sure that the words before the options are a verb.

    Parameters
    ----------
    verbs
        By the first word, what may come after it; empty where that is up to the verb.

    Raises
    ------
    InputError
        If they are not; the verb that is nearest is named.
    """
    if not given or given[0].startswith("-"):
        return
    first, *rest = given
    if first not in verbs:
        _refuse(first, "", verbs)
    second = rest[0] if rest else ""
    if verbs[first] and second and not second.startswith("-") and second not in verbs[first]:
        _refuse(second, f"{first} ", verbs[first])


def _refuse(word: str, before: str, known: Sequence[str] | Mapping[str, Any]) -> None:
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.55)
    # "build" is a verb of several things, and none by itself.
    meant = f"did you mean vico {before}{near[0]}?" if near else f"there are {', '.join(known)}"
    raise InputError(f"no verb {before + word!r}; {meant}")


_VERBOSITY = {"--verbose": logging.INFO, "--quiet": logging.ERROR}

app = SubcommandApp()


def run(options: Annotated[RunOptions, FLAT]) -> int:
    """Simulate a community: residents follow their schedules among robots, traffic and transit.

    Example: vico run helsinki people --start 08:00 --steps 1800 --out morning

    Example: vico run helsinki people --observe none --robots none --out fast
    """
    from vico.cli.run import run as simulate

    return simulate(options)


check = SubcommandApp()
check.command(name="world")(check_world)
check.command(name="community")(check_community)
# Verbs of several words, by the first.
_GROUPS = {
    "world": world,
    "city": city,
    "community": community,
    "check": check,
    "assets": assets,
    "motion": motion,
    "llm": language_model,
    "eval": evaluation,
    "dataset": dataset,
    "leaderboard": leaderboard,
}
# Help lists them in this order.
app.command(name="export")(export)
app.command(name="run")(run)
app.command(name="replay")(replay)
app.command(name="film")(film)
app.command(name="still")(still)
app.command(name="score-pictures")(score_pictures)
app.command(name="demo")(demo)
app.command(name="doctor")(doctor)
app.command(name="bench")(bench)
app.command(name="warm-up")(warm_up)
app.command(world, name="world", help="Make worlds and look into them.")
app.command(city, name="city", help="Make cities of tiles.")
app.command(community, name="community", help="People a world.")
app.command(check, name="check", help="Check a world or a community.")
app.command(assets, name="assets", help="Richer bodies, robots and things; things out of words.")
app.command(motion, name="motion", help="Motions of other programs, and of recorded people.")
app.command(language_model, name="llm", help="A language model on this machine.")
app.command(evaluation, name="eval", help="Judge agents on a challenge.")
app.command(dataset, name="dataset", help="Datasets of demonstrations, for trainers.")
app.command(leaderboard, name="leaderboard", help="A public file of what methods came to.")
app.command(name="check-agent")(check_agent)
app.command(name="view")(view)
app.command(name="live")(live)
app.command(name="play")(play)


_log = logging.getLogger("vico")


def _fault(error: Exception) -> str:
    """Say what went wrong that is not the caller's doing; the traceback goes to the log."""
    _log.info("where it failed", exc_info=error)
    return (
        f"{sentence_of(error)} at {line_of(error)}: a fault of vico; please report it, with what the same command says "
        "after vico --verbose"
    )


def _sentence(error: OSError) -> str:
    """Say what the operating system refused, where, and what to do about it."""
    if error.filename is None and error.errno != errno.ENOSPC:
        return _fault(error)
    where = f"{error.filename}: " if error.filename is not None else ""
    return f"{where}{reason_of(error, writing=False)}"


def _configure_logging(given: list[str]) -> list[str]:
    """Let warnings of the library go to stderr, more or less with `_VERBOSITY` before the verb; return the rest."""
    level = _VERBOSITY.get(given[0]) if given else None
    logging.basicConfig(format="vico: %(message)s")
    logging.getLogger("vico").setLevel(logging.WARNING if level is None else level)
    return given if level is None else given[1:]


def _replace_what_cannot_be_shown() -> None:
    """Let a terminal of seven bits show what it can of a name, where Python would end the program."""
    for stream, errors in ((sys.stdout, "replace"), (sys.stderr, "backslashreplace")):
        if isinstance(stream, io.TextIOWrapper) and stream.errors in ("strict", "surrogateescape"):
            # In the C locale Python lets through what it could not read, and no more.
            stream.reconfigure(errors=errors)


def _leave(code: int, sentence: str = "") -> NoReturn:
    """Say why, and end with this exit code when all that was printed is out."""
    try:
        if sentence:
            print(f"vico: {sentence}", file=sys.stderr)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        # Whoever read the output, `head` for one, has had enough; nothing may be flushed into the closed pipe.
        # Both may be the pipe (2>&1), and what is left for either would be flushed into it when the program ends.
        for stream in (sys.stdout, sys.stderr):
            os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
        code = code or 141
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        print(f"vico: stdout: {reason_of(error)}", file=sys.stderr)
        code = 2
    sys.exit(code)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; a sentence for whatever goes wrong, never a traceback."""
    gc.set_threshold(20_000, 20, 20)  # what is imported is never garbage: imports alone take a seventh less
    _replace_what_cannot_be_shown()
    given = _configure_logging(sys.argv[1:] if arguments is None else arguments)
    try:
        if given == ["--version"]:
            print(__version__)
            _leave(0)
        verbs = {name: list(_GROUPS[name]._subcommands) if name in _GROUPS else [] for name in app._subcommands}
        check_verb(given, verbs)
        with ended_by_signals():
            code = app.cli(
                prog="vico",
                description="An open world for humans, robots and society.",
                args=with_ray_address(given),
                registry=REGISTRY,
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.OmitArgPrefixes),
            )
    except SystemExit as end:  # help was asked for, options were refused, or rich found the pipe closed
        _leave(141 if isinstance(end.__context__, BrokenPipeError) else end.code if isinstance(end.code, int) else 0)
    except VicoError as error:
        _leave(2, str(error))
    except BrokenPipeError:
        _leave(141)
    except OSError as error:
        _leave(2, _sentence(error))
    except KeyboardInterrupt as stop:
        _leave(exit_code(stop), str(stop) or "stopped; what was finished is on disk")
    except Exception as error:  # whatever: who runs a command is not who mends the program
        _leave(2, _fault(error))
    _leave(code)


if __name__ == "__main__":
    main()
