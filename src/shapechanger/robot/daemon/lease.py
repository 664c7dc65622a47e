"""Who commands: one at a time, and a person before a program."""

from __future__ import annotations

from dataclasses import dataclass

from shapechanger.link.messages import Role

__all__ = ["Holder", "LeaseDesk"]


@dataclass(frozen=True, slots=True)
class Holder:
    """Somebody who may command.

    Attributes:
        session: Number of the connection.
        name: Who it is, for people to read.
        role: Who drives.
    """

    session: int
    name: str
    role: Role


class LeaseDesk:
    """Gives the command to one connection at a time.

    Attributes:
        number: Number of the lease in force, or of the last one; each is larger than the one
            before, so that commands of an old one can be told.
    """

    def __init__(self) -> None:
        self.number = 0
        self._holder: Holder | None = None

    @property
    def holder(self) -> Holder | None:
        """Who commands; None for nobody."""
        return self._holder

    def holds(self, session: int) -> bool:
        """Whether a connection commands."""
        return self._holder is not None and self._holder.session == session

    def refusal(self, who: Holder) -> str:
        """Why somebody cannot take the command now; empty when they can."""
        held = self._holder
        if held is None or held.session == who.session:
            return ""
        if who.role == "person" and held.role == "program":
            return ""
        return f"{held.name} commands; a {who.role} cannot take it from a {held.role}."

    def take(self, who: Holder) -> Holder | None:
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
