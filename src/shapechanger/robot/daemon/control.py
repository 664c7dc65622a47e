"""Control lease and pending commands: which client commands the robot, and what it asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from shapechanger.link.messages import Role

_NS_PER_MS: Final = 1_000_000


@dataclass(frozen=True, slots=True)
class ClientIdentity:
    """Identity of a connected client.

    Attributes:
        session: Number of the connection.
        name: Display name.
        role: "person" or "program".
    """

    session: int
    name: str
    role: Role


class ControlLease:
    """Control of the robot, held by one connection at a time.

    Attributes:
        number: Number of the current lease, or of the last one. Each lease has a larger number
            than the one before, so that commands of an earlier lease can be recognised.
    """

    def __init__(self) -> None:
        self.number = 0
        self._holder: ClientIdentity | None = None

    @property
    def holder(self) -> ClientIdentity | None:
        """The client that holds the lease, or None."""
        return self._holder

    def holds(self, session: int) -> bool:
        """Return True if this connection holds the lease."""
        return self._holder is not None and self._holder.session == session

    def refusal(self, client: ClientIdentity) -> str:
        """Return the reason why `client` cannot take the lease now, or "" if it can."""
        held = self._holder
        if held is None or held.session == client.session:
            return ""
        if client.role == "person" and held.role == "program":
            return ""
        return f"{held.name} has control; a {client.role} cannot take it from a {held.role}."

    def take(self, client: ClientIdentity) -> ClientIdentity | None:
        """Give the lease to a client that `refusal` accepts.

        Returns:
            The client that lost the lease, or None.
        """
        held = self._holder
        if held is not None and held.session == client.session:
            return None
        self._holder = client
        self.number += 1
        return held

    def release(self, session: int) -> bool:
        """End the lease of a connection. Return False if the connection did not hold it."""
        if not self.holds(session):
            return False
        self._holder = None
        return True


@dataclass(frozen=True, slots=True)
class PendingCommand:
    """A command or a suggestion, with its expiry time.

    Attributes:
        client: The client that sent it.
        values: One number for each action of the robot.
        until_ns: Expiry on the robot's clock, ns.
    """

    client: ClientIdentity
    values: tuple[float, ...]
    until_ns: int


class PendingCommands:
    """The newest command and the newest suggestion, until they expire.

    Args:
        deadline_ms: Longest lifetime of either, ms.
    """

    def __init__(self, deadline_ms: int) -> None:
        self._deadline_ms = deadline_ms
        self._command: PendingCommand | None = None
        self._suggestion: PendingCommand | None = None

    def command(
        self, client: ClientIdentity, values: tuple[float, ...], ttl_ms: int, now_ns: int
    ) -> None:
        """Replace the command of the lease holder.

        Args:
            client: The lease holder.
            values: One number for each action of the robot.
            ttl_ms: Lifetime, ms; the deadline holds where it is shorter.
            now_ns: Time of arrival on the robot's clock, ns.
        """
        until_ns = now_ns + _NS_PER_MS * min(ttl_ms, self._deadline_ms)
        self._command = PendingCommand(client, values, until_ns)

    def clear_command(self) -> None:
        """Drop the command."""
        self._command = None

    def suggest(self, client: ClientIdentity, values: tuple[float, ...], now_ns: int) -> None:
        """Replace the suggestion, which comes from a client without the lease.

        Args:
            client: The client that sent it.
            values: One number for each action of the robot.
            now_ns: Time of arrival on the robot's clock, ns.
        """
        self._suggestion = PendingCommand(client, values, now_ns + _NS_PER_MS * self._deadline_ms)

    def forget(self, session: int) -> None:
        """Drop the suggestion of a client that left or took the lease."""
        if self._suggestion is not None and self._suggestion.client.session == session:
            self._suggestion = None

    def commanded(self, now_ns: int) -> tuple[float, ...]:
        """Return the values of the unexpired command, or () if there is none."""
        pending = self._command
        return () if pending is None or now_ns > pending.until_ns else pending.values

    def suggested(self, now_ns: int) -> PendingCommand | None:
        """Return the unexpired suggestion, or None."""
        pending = self._suggestion
        return None if pending is None or now_ns > pending.until_ns else pending
