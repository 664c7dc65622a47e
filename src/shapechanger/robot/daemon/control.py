"""Control lease: which client commands the robot."""

from __future__ import annotations

from dataclasses import dataclass

from shapechanger.robot.link.messages import Role


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
        holder: The client that holds the lease, or None.
    """

    def __init__(self) -> None:
        self.number = 0
        self.holder: ClientIdentity | None = None

    @property
    def holder_name(self) -> str:
        """Name of the client that holds the lease; "" for none."""
        return "" if self.holder is None else self.holder.name

    def holds(self, session: int) -> bool:
        """Return True if this connection holds the lease."""
        return self.holder is not None and self.holder.session == session

    def refusal(self, client: ClientIdentity) -> str:
        """Return the reason why `client` cannot take the lease now, or "" if it can."""
        held = self.holder
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
        held = self.holder
        if held is not None and held.session == client.session:
            return None
        self.holder = client
        self.number += 1
        return held

    def release(self, session: int) -> bool:
        """End the lease of a connection. Return False if the connection did not hold it."""
        if not self.holds(session):
            return False
        self.holder = None
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
