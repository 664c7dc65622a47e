"""What the commands print with."""

from __future__ import annotations

from rich.console import Console

__all__ = ["plain_console"]


def plain_console(*, stderr: bool = False, width: int | None = None) -> Console:
    """A console that prints names as they are: `a[b]` is no markup, and `:a:` no emoji.

    Args:
        stderr: Whether to print on the standard error.
        width: Columns; None for those of the terminal.
    """
    return Console(stderr=stderr, width=width, markup=False, emoji=False, highlight=False)
