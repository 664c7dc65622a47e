"""Entry point of the command line; turns every user error into one sentence."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Sequence
from importlib.metadata import version
from typing import Annotated, Any, Final, NoReturn, get_args, get_type_hints

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

    from shapechanger.cli.console import Interrupted
    from shapechanger.cli.demos import Demos
    from shapechanger.cli.doctor import ExamineMachine
    from shapechanger.cli.envs import Envs
    from shapechanger.cli.finger import Finger
    from shapechanger.cli.play import Play
    from shapechanger.cli.policies import Policies
    from shapechanger.cli.robot import Robot
    from shapechanger.cli.suite import Suite
    from shapechanger.cli.train import Train
    from shapechanger.cli.transfer import Methods, Transfer
except KeyboardInterrupt:  # pragma: no cover  # Tested in a subprocess.
    print("Stopped.", file=sys.stderr)
    sys.exit(_INTERRUPTED)

_Command = (
    Annotated[Envs, tyro.conf.subcommand("envs")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Play, tyro.conf.subcommand("play")]
    | Annotated[Transfer, tyro.conf.subcommand("transfer")]
    | Annotated[Suite, tyro.conf.subcommand("suite")]
    | Annotated[Methods, tyro.conf.subcommand("methods")]
    | Annotated[Policies, tyro.conf.subcommand("policies")]
    | Annotated[Robot, tyro.conf.subcommand("robot")]
    | Annotated[Demos, tyro.conf.subcommand("demos")]
    | Annotated[Finger, tyro.conf.subcommand("finger")]
    | Annotated[ExamineMachine, tyro.conf.subcommand("doctor")]
)


# Options that take several values.
_SEVERAL: Final = ("--set", "--rule", "--arms", "--only")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line.

    Exits with 0 on success, with 2 and one sentence on standard error for wrong usage or a missing
    requirement, and with 130 after Ctrl-C.
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
        _stop(
            f"error: {(str(error).strip().splitlines() or [type(error).__name__])[0]}", _WRONG_USAGE
        )
    except Interrupted as stop:
        _stop(str(stop), _INTERRUPTED)
    except KeyboardInterrupt:
        _stop("Stopped.", _INTERRUPTED)
    except OSError as error:
        # With a file name it should have been translated before: a defect.
        if error.errno not in {errno.ENOSPC, errno.EPIPE} or error.filename is not None:
            raise
        # Python flushes stdout again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:  # The reader closed the pipe.
            sys.exit(1)
        _stop(f"error: Not everything could be printed: {error.strerror}.", _WRONG_USAGE)


def parse(arguments: Sequence[str]) -> Any:
    """Return the command that a command line names, which its `run` executes."""
    said, leaf_class = find_command(arguments)
    if leaf_class is not None:
        _require_options(arguments, said, leaf_class)
    _require_single(arguments)
    command = tyro.cli(
        _Command,
        prog="shapechanger",
        description=(
            "Learn a skill in one body, move it to another, and measure the gain. Begin with "
            "`shapechanger doctor`, then `shapechanger transfer InvertedPendulum "
            "BigInvertedPendulum --quick`; each command has --help."
        ),
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.DisallowNone),
    )
    return getattr(command, "command", command)  # A group holds its subcommand.


def find_command(arguments: Sequence[str]) -> tuple[str, type | None]:
    """Return the words of the command and its class; None if it has no subcommand yet."""
    said, kinds = "shapechanger", _commands(_Command)
    for word in arguments:
        name = word.replace("_", "-")  # As tyro.
        if word.startswith("-"):
            break
        if name not in kinds:
            raise UnknownName(f"command of `{said}`", word, kinds)
        said, kind = f"{said} {name}", kinds[name]
        kinds = _commands(kind)
        if not kinds:
            return said, kind
    return said, None


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
    """Raise an error of one sentence for an option that no parser can read."""
    named = options_of(kind)
    flags = [name for name, hint in named.items() if hint is bool]
    options = [*named, *(name.replace("--", "--no-", 1) for name in flags), "--help"]
    for word, value in zip(arguments, [*arguments[1:], "--"], strict=True):
        if not word.startswith("--"):
            continue
        given, equals, _ = word.partition("=")
        option = given.replace("_", "-")  # As tyro.
        if option not in options:
            raise UnknownName(f"option of `{said}`", given, sorted(options))
        # Without a value, one of several values would mean its default.
        takes = option in named and option not in flags
        if takes and not equals and value.startswith("--"):
            raise StudyError(f"{given} needs a value after it: see `{said} --help`.")


def _require_single(arguments: Sequence[str]) -> None:
    """Raise StudyError for an option of several values, or a policy, that is given twice.

    The first one would be dropped without a word. For other options the last one counts.
    """
    options = [word.partition("=")[0] for word in arguments]
    for name in _SEVERAL:
        if options.count(name) > 1:
            raise StudyError(f"{name} is given twice: give it once, with all its values after it.")
    if options.count("--policy") > 1:
        raise StudyError("--policy is given twice, and one policy drives at a time: give it once.")


def _commands(kind: Any) -> dict[str, Any]:
    """Return the subcommands of a command or of a union, keyed by name."""
    if isinstance(kind, type):
        grouped = "command" in kind.__annotations__
        kind = get_type_hints(kind, include_extras=True)["command"] if grouped else None
    pairs = (get_args(annotated) for annotated in get_args(kind))
    return {config.name: command for command, config in pairs}


def _stop(message: str, code: int) -> NoReturn:
    """Print a message and exit."""
    plain_console(stderr=True).print(message, soft_wrap=True)
    sys.exit(code)
