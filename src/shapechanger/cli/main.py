"""Where the command line begins, and where every error of a user becomes one sentence."""

from __future__ import annotations

import errno
import io
import os
import sys
from collections.abc import Sequence
from typing import Annotated, Final, NoReturn

from shapechanger.errors import MissingExtra, ShapechangerError

# What shells give for a program that Ctrl-C has ended (128 plus SIGINT), and for wrong usage.
_INTERRUPTED: Final = 130
_WRONG_USAGE: Final = 2

# Ctrl-C may come while all this loads.
try:
    import gymnasium as gym

    try:
        import tyro

        from shapechanger.cli.console import plain_console
    except ImportError:  # pragma: no cover  # Seen by a process of its own in the tests.
        sys.exit(f"error: {MissingExtra('tyro and rich', 'cli')}")

    from shapechanger.cli.console import Interrupted
    from shapechanger.cli.demos import Demos
    from shapechanger.cli.envs import Envs
    from shapechanger.cli.finger import Finger
    from shapechanger.cli.play import Play
    from shapechanger.cli.robot import Robot
    from shapechanger.cli.suite import Suite
    from shapechanger.cli.train import Train
    from shapechanger.cli.transfer import Transfer
except KeyboardInterrupt:  # pragma: no cover  # Seen by a process of its own in the tests.
    print("Stopped.", file=sys.stderr)
    sys.exit(_INTERRUPTED)

__all__ = ["main"]

_Command = (
    Annotated[Envs, tyro.conf.subcommand("envs")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Play, tyro.conf.subcommand("play")]
    | Annotated[Transfer, tyro.conf.subcommand("transfer")]
    | Annotated[Suite, tyro.conf.subcommand("suite")]
    | Annotated[Robot, tyro.conf.subcommand("robot")]
    | Annotated[Demos, tyro.conf.subcommand("demos")]
    | Annotated[Finger, tyro.conf.subcommand("finger")]
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Do what the command line says.

    Exits with 0 when it was done, 2 with one sentence on the standard error when it was asked
    wrongly or cannot be done here, and 130 after Ctrl-C.
    """
    for stream in (sys.stdout, sys.stderr):
        # Where the encoding lacks a letter, a question mark is better than no answer.
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    try:
        command = tyro.cli(
            _Command,
            prog="shapechanger",
            description="Learn a skill in one body, move it to another, and measure the gain.",
            args=arguments,
            config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.DisallowNone),
        )
        command.run()
        sys.stdout.flush()
    except ShapechangerError as error:
        _stop(f"error: {error}", _WRONG_USAGE)
    except gym.error.Error as error:
        # Of the envs of others, such as one that draws with a package that is not there.
        _stop(
            f"error: {(str(error).strip().splitlines() or [type(error).__name__])[0]}", _WRONG_USAGE
        )
    except Interrupted as stop:
        _stop(str(stop), _INTERRUPTED)
    except KeyboardInterrupt:
        _stop("Stopped.", _INTERRUPTED)
    except OSError as error:
        # With a file's name it is about that file, and a defect if nobody said it in words.
        if error.errno not in {errno.ENOSPC, errno.EPIPE} or error.filename is not None:
            raise
        # Python tries to write what is left once more at its end.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if error.errno == errno.EPIPE:  # Whoever read has enough.
            sys.exit(1)
        _stop(f"error: Not everything could be printed: {error.strerror}.", _WRONG_USAGE)


def _stop(message: str, code: int) -> NoReturn:
    """Say why, and end."""
    plain_console(stderr=True).print(message, soft_wrap=True)
    sys.exit(code)
