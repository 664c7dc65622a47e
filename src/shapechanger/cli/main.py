"""Entry point of the command line; prints an error of the user without a traceback."""

from __future__ import annotations

import ast
import errno
import io
import itertools
import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Final, NoReturn, Union, get_args, get_origin, get_type_hints

from shapechanger.errors import MissingExtra, ShapechangerError, StudyError, UnknownName

# Exit codes of shells for Ctrl-C (128 plus SIGINT) and for wrong usage.
_INTERRUPTED: Final = 130
_WRONG_USAGE: Final = 2

# Ctrl-C may arrive during the imports.
try:
    import gymnasium as gym

    try:
        import tyro

        from shapechanger.cli.console import plain_console
    except ImportError:  # pragma: no cover  # Tested in a subprocess.
        sys.exit(f"error: {MissingExtra('tyro and rich', 'cli')}")
except KeyboardInterrupt:  # pragma: no cover  # Tested in a subprocess.
    print("Stopped.", file=sys.stderr)
    sys.exit(_INTERRUPTED)


@dataclass(frozen=True)
class Group:
    """Commands with the same first word: the help text, and module and class of each command."""

    summary: str
    commands: Mapping[str, str | Group]


def _group(group: str, summary: str, modules: Mapping[str, Sequence[str]]) -> Group:
    """Return a group from the commands in each module; `suite run` has the class `SuiteRun`."""
    places = {
        name: f"{module}:{group.title()}{name.title().replace('-', '')}"
        for module, names in modules.items()
        for name in names
    }
    return Group(summary, places)


COMMANDS: Final = Group(
    "Learn a skill in one body, move it to another, and measure the gain. Begin with "
    "`shapechanger doctor`, then `shapechanger transfer InvertedPendulum BigInvertedPendulum "
    "--quick`; each command has --help.",
    {
        "envs": "envs:Envs",
        "train": "train:Train",
        "play": "policies:Play",
        "transfer": "transfer:Transfer",
        "suite": _group(
            "suite",
            "Run, watch, merge and list suites: many studies with one page.",
            {"suite": ("run", "watch", "merge", "list")},
        ),
        "policies": _group(
            "policies",
            "Show, evaluate, export and convert policies.",
            {"policies": ("show", "evaluate", "export", "convert")},
        ),
        "robot": _group(
            "robot",
            "Set up, serve, find, drive and test robots.",
            {
                "robot.setup": ("init", "install", "key"),
                "robot.check": ("check",),
                "robot.calibrate": ("calibrate",),
                "robot.camera": ("camera",),
                "robot.serve": ("serve",),
                "robot.remote": ("find", "remember", "fetch", "stop"),
                "robot.drive": ("drive",),
            },
        ),
        "demos": _group(
            "demos",
            "Record, show, edit and convert demonstrations, and learn from them.",
            {
                "demos.record": ("record", "replay"),
                "demos.recordings": ("show", "edit", "merge", "repair", "import", "export"),
                "demos.train": ("train", "evaluate"),
            },
        ),
        "finger": _group(
            "finger",
            "Record, identify and export a finger.",
            {"finger": ("record", "identify", "export")},
        ),
        "hub": _group(
            "hub",
            "Share policies and recordings on the Hugging Face Hub.",
            {"hub": ("push", "pull")},
        ),
        "doctor": "doctor:Doctor",
    },
)
"""Module and class of each command in this package, so that only the given one is imported."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line.

    Returns on success. Exits with 2 and a message on standard error for wrong usage or a missing
    requirement, with 130 after Ctrl-C, and with 1 if the reader of the output has closed the pipe.
    """
    for stream in (sys.stdout, sys.stderr):
        # Characters that the encoding lacks become question marks.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        given = sys.argv[1:] if arguments is None else arguments
        if list(given) == ["--version"]:
            print(f"shapechanger {version('shapechanger')}")
            return
        parse(given).run()
        sys.stdout.flush()
    except ShapechangerError as error:
        _stop(f"error: {error}", _WRONG_USAGE)
    except gym.error.Error as error:
        # From third-party envs, such as one whose renderer is not installed.
        lines = str(error).strip().splitlines() or [type(error).__name__]
        _stop(f"error: {lines[0]}", _WRONG_USAGE)
    except KeyboardInterrupt as stop:  # The message of `Interrupted` explains how to resume.
        _stop(str(stop) or "Stopped.", _INTERRUPTED)
    except OSError as error:
        # Other errors, and errors with a file name, should have been translated: show a traceback.
        if error.errno not in {errno.ENOSPC, errno.EPIPE} or error.filename is not None:
            raise
        # Python flushes stdout again at exit, which must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:  # The reader closed the pipe.
            sys.exit(1)
        _stop(f"error: Not everything could be printed: {error.strerror}.", _WRONG_USAGE)


def parse(arguments: Sequence[str]) -> Any:
    """Parse a command line into a command, which `run` executes."""
    names, command = find_command(arguments)
    rest, prog = arguments[len(names) :], " ".join(("shapechanger", *names))
    kind: Any = Union
    if isinstance(command, Group):
        described = [
            Annotated[_NotLoaded, tyro.conf.subcommand(name, description=_summary(place))]
            for name, place in command.commands.items()
        ]
        kind, description = kind[tuple(described)], command.summary
        rest = rest or ["--help"]  # tyro would only say that a command is missing.
    else:
        _require_options(rest, prog, command)
        kind, description = command, None
    config = (tyro.conf.OmitSubcommandPrefixes, tyro.conf.DisallowNone)
    return tyro.cli(kind, prog=prog, description=description, args=rest, config=config)


@dataclass(frozen=True)
class _NotLoaded:
    """Placeholder for a command in the help of its group, so that its module is not imported."""


def find_command(arguments: Sequence[str]) -> tuple[list[str], type | Group]:
    """Return the first words of a command line, which name a command, and its class or group."""
    names: list[str] = []
    found: str | Group = COMMANDS
    for word in arguments:
        if isinstance(found, str) or word.startswith("-"):
            break
        name = word.replace("_", "-")  # tyro converts names in the same way.
        if name not in found.commands:
            group = " ".join(("shapechanger", *names))
            raise UnknownName(f"command of `{group}`", word, found.commands)
        names.append(name)
        found = found.commands[name]
    if isinstance(found, Group):
        return names, found
    module, _, kind = found.partition(":")
    return names, getattr(import_module(f"shapechanger.cli.{module}"), kind)


def _summary(command: str | Group) -> str:
    """Return a command's line for the help of its group, from the source of its class."""
    if isinstance(command, Group):
        return command.summary
    module, _, kind = command.partition(":")
    file = Path(__file__).parent.joinpath(*module.split(".")).with_suffix(".py")
    classes = (node for node in ast.parse(file.read_text()).body if isinstance(node, ast.ClassDef))
    text = next(ast.get_docstring(node) for node in classes if node.name == kind) or ""
    return " ".join(text.partition("\n\n")[0].split())


def options_of(kind: type) -> dict[str, Any]:
    """Return the types of a command's options, keyed by option, such as `--out`."""
    named: dict[str, Any] = {}
    for field, hint in get_type_hints(kind, include_extras=True).items():
        settings = getattr(hint, "__metadata__", ())
        if tyro.conf.Positional not in settings:
            # An option may have another name than its field, such as `from`.
            other = next((name for one in settings if (name := getattr(one, "name", None))), None)
            plain = get_args(hint)[0] if settings else hint
            named["--" + (other or field).replace("_", "-")] = plain
    return named


def _require_options(arguments: Sequence[str], said: str, kind: type) -> None:
    """Raise an error of one sentence for an unknown option, or an option without its value.

    An option with several values, or --policy, must not be given twice: its first values would be
    dropped silently. For other options the last value counts.
    """
    named = options_of(kind)
    flags = [name for name, hint in named.items() if hint is bool]
    options = [*named, *(name.replace("--", "--no-", 1) for name in flags), "--help"]
    seen: set[str] = set()
    for word, value in itertools.pairwise([*arguments, "--"]):
        if not word.startswith("--"):
            continue
        given, equals, _ = word.partition("=")
        option = given.replace("_", "-")  # tyro converts names in the same way.
        if option not in options:
            raise UnknownName(f"option of `{said}`", given, sorted(options))
        # tyro would use the default for an option of several values that has none.
        if option in named and option not in flags and not equals and value.startswith("--"):
            raise StudyError(f"{given} needs a value after it: see `{said} --help`.")
        if option in seen and get_origin(named.get(option)) is tuple:
            raise StudyError(f"{given} must be given once, with all its values after it.")
        if option in seen and option == "--policy":
            raise StudyError("--policy must be given once.")
        seen.add(option)


def _stop(message: str, code: int) -> NoReturn:
    plain_console(stderr=True).print(message, soft_wrap=True)
    sys.exit(code)
