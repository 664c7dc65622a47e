"""Where the command line begins, and where every error of a user becomes one sentence."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Annotated, Final

from shapechanger.errors import MissingExtra, ShapechangerError

try:
    import tyro
    from rich.console import Console
except ImportError:  # pragma: no cover  # Seen by a process of its own in the tests.
    sys.exit(f"error: {MissingExtra('tyro and rich', 'cli')}")

from shapechanger.cli.envs import Envs
from shapechanger.cli.play import Play
from shapechanger.cli.stopping import Interrupted
from shapechanger.cli.train import Train
from shapechanger.cli.transfer import Transfer

__all__ = ["main"]

# What shells give for a program that Ctrl-C has ended (128 plus SIGINT), and for wrong usage.
_INTERRUPTED: Final = 130
_WRONG_USAGE: Final = 2

_Command = (
    Annotated[Envs, tyro.conf.subcommand("envs")]
    | Annotated[Train, tyro.conf.subcommand("train")]
    | Annotated[Play, tyro.conf.subcommand("play")]
    | Annotated[Transfer, tyro.conf.subcommand("transfer")]
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Do what the command line says.

    Exits with 0 when it was done, 2 with one sentence on the standard error when it was asked
    wrongly or cannot be done here, and 130 after Ctrl-C.
    """
    command = tyro.cli(
        _Command,
        prog="shapechanger",
        description="Learn a skill in one body, move it to another, and measure the gain.",
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.DisallowNone),
    )
    console = Console(stderr=True, soft_wrap=True, highlight=False, markup=False)
    try:
        command.run()
    except ShapechangerError as error:
        console.print(f"error: {error}")
        sys.exit(_WRONG_USAGE)
    except Interrupted as stop:
        console.print(str(stop))
        sys.exit(_INTERRUPTED)
    except KeyboardInterrupt:
        console.print("Stopped.")
        sys.exit(_INTERRUPTED)
