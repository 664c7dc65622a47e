"""What a process needs of the twin's board, wherever the board is."""

from __future__ import annotations

from typing import Any, Protocol

from shapechanger.twin import wire

__all__ = ["BoardLink", "EdgeListener"]


class EdgeListener(Protocol):
    """Is told of the edges of inputs."""

    def __call__(self, pin: int, level: int, at_ns: int, /) -> None:
        """A pin has changed to a level at a time."""
        ...


class BoardLink(Protocol):
    """A way to the board: a socket to another process, or the board itself in this one.

    Attributes:
        levels: Level of each pin that is claimed as an input.
        on_edge: Whom to tell of edges.
    """

    levels: dict[int, int]
    on_edge: EdgeListener | None

    @property
    def closed(self) -> bool:
        """Whether it was closed here."""
        ...

    def post(self, **message: Any) -> None:
        """Say something that needs no answer."""
        ...

    def ask(self, **message: Any) -> wire.Message:
        """Say something and get the answer."""
        ...

    def drain(self) -> None:
        """Take in everything that has arrived, without waiting."""
        ...
