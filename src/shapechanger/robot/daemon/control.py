"""Who commands: one at a time, and a person before a program."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from shapechanger.link.messages import Role

__all__ = ["ClientIdentity", "ControlLease", "PendingCommand", "PendingCommands"]


@dataclass(frozen=True, slots=True)
class ClientIdentity:
    """Somebody who may command.

    Attributes:
        session: Number of the connection.
        name: Who it is, for people to read.
        role: Who drives.
    """

    session: int
    name: str
    role: Role


class ControlLease:
    """Gives the command to one connection at a time.

    Attributes:
        number: Number of the lease in force, or of the last one; each is larger than the one
            before, so that commands of an old one can be told.
    """

    def __init__(self) -> None:
        self.number = 0
        self._holder: ClientIdentity | None = None

    @property
    def holder(self) -> ClientIdentity | None:
        """Who commands; None for nobody."""
        return self._holder

    def holds(self, session: int) -> bool:
        """Whether a connection commands."""
        return self._holder is not None and self._holder.session == session

    def refusal(self, who: ClientIdentity) -> str:
        """Why somebody cannot take the command now; empty when they can."""
        held = self._holder
        if held is None or held.session == who.session:
            return ""
        if who.role == "person" and held.role == "program":
            return ""
        return f"{held.name} commands; a {who.role} cannot take it from a {held.role}."

    def take(self, who: ClientIdentity) -> ClientIdentity | None:
        """Give the command to somebody whom `refusal` did not refuse.

        Returns:
            Who lost it by that; None for nobody.
        """
        held = self._holder
        if held is not None and held.session == who.session:
            return None
        self._holder = who
        self.number += 1
        return held

    def give_up(self, session: int) -> bool:
        """Take the command from a connection; whether it had it."""
        if not self.holds(session):
            return False
        self._holder = None
        return True


_NS_PER_MS: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class PendingCommand:
    """What somebody wants, and until when.

    Attributes:
        who: Who it is.
        values: One number for each action of the robot.
        until_ns: When it is forgotten, of the robot's time.
    """

    who: ClientIdentity
    values: tuple[float, ...]
    until_ns: int


class PendingCommands:
    """The newest command and the newest suggestion, each as long as it counts.

    Args:
        deadline_ms: How long either counts at most.
    """

    def __init__(self, deadline_ms: int) -> None:
        self._deadline_ms = deadline_ms
        self._command: PendingCommand | None = None
        self._suggestion: PendingCommand | None = None

    def command(
        self, who: ClientIdentity, values: tuple[float, ...], ttl_ms: int, now_ns: int
    ) -> None:
        """Somebody commands."""
        until_ns = now_ns + _NS_PER_MS * min(ttl_ms, self._deadline_ms)
        self._command = PendingCommand(who, values, until_ns)

    def end_command(self) -> None:
        """The newest command is taken back."""
        self._command = None

    def suggest(self, who: ClientIdentity, values: tuple[float, ...], now_ns: int) -> None:
        """Somebody who does not command says what they would do."""
        self._suggestion = PendingCommand(who, values, now_ns + _NS_PER_MS * self._deadline_ms)

    def forget(self, session: int) -> None:
        """Somebody has left, or commands now: what they suggested does not count any more."""
        if self._suggestion is not None and self._suggestion.who.session == session:
            self._suggestion = None

    def commanded(self, now_ns: int) -> tuple[float, ...]:
        """The newest command that is in force; empty for none."""
        wish = self._command
        return () if wish is None or now_ns > wish.until_ns else wish.values

    def suggested(self, now_ns: int) -> PendingCommand | None:
        """The newest suggestion; None for none."""
        wish = self._suggestion
        return None if wish is None or now_ns > wish.until_ns else wish
