"""What clients want at this moment: the command that is in force, and what others would do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from shapechanger.robot.daemon.lease import Holder

__all__ = ["Wish", "Wishes"]

_NS_PER_MS: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class Wish:
    """What somebody wants, and until when.

    Attributes:
        who: Who it is.
        values: One number for each action of the robot.
        until_ns: When it is forgotten, of the robot's time.
    """

    who: Holder
    values: tuple[float, ...]
    until_ns: int


class Wishes:
    """The newest command and the newest suggestion, each as long as it counts.

    Args:
        deadline_ms: How long either counts at most.
    """

    def __init__(self, deadline_ms: int) -> None:
        self._deadline_ms = deadline_ms
        self._command: Wish | None = None
        self._suggestion: Wish | None = None

    def command(self, who: Holder, values: tuple[float, ...], ttl_ms: int, now_ns: int) -> None:
        """Somebody commands."""
        until_ns = now_ns + _NS_PER_MS * min(ttl_ms, self._deadline_ms)
        self._command = Wish(who, values, until_ns)

    def end_command(self) -> None:
        """The newest command is taken back."""
        self._command = None

    def suggest(self, who: Holder, values: tuple[float, ...], now_ns: int) -> None:
        """Somebody who does not command says what they would do."""
        self._suggestion = Wish(who, values, now_ns + _NS_PER_MS * self._deadline_ms)

    def forget(self, session: int) -> None:
        """Somebody has left, or commands now: what they suggested does not count any more."""
        if self._suggestion is not None and self._suggestion.who.session == session:
            self._suggestion = None

    def commanded(self, now_ns: int) -> tuple[float, ...]:
        """The newest command that is in force; empty for none."""
        wish = self._command
        return () if wish is None or now_ns > wish.until_ns else wish.values

    def suggested(self, now_ns: int) -> Wish | None:
        """The newest suggestion; None for none."""
        wish = self._suggestion
        return None if wish is None or now_ns > wish.until_ns else wish
