"""Control lease, pending commands, and the observations of clients."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from shapechanger.layout import Layout
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.guard.messages import GuardState
from shapechanger.robot.link.messages import Observation, Role


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


_ABSENT: Final = "absent"
"""Source of a quantity that no sensor measures; its value is NaN, never an invented 0."""

_APPLIED: Final = "/applied"


@dataclass(frozen=True, slots=True)
class NumberedFrame:
    """A valid frame and its number; equal numbers mean the same frame."""

    seq: int
    frame: Frame


class StateReader:
    """Orders the quantities of the guard as in the state layout."""

    def __init__(self, state_layout: Layout, action_layout: Layout) -> None:
        features = state_layout.features
        self._names = [f.name for f in features for _ in range(f.size)]
        self._places = {f"{name}{_APPLIED}": i for i, name in enumerate(action_layout.names)}
        self._measured = [f.name for f in features if not f.name.endswith(_APPLIED)]

    def values(self, state: GuardState | None) -> tuple[float, ...]:
        """Return the numbers of the state layout, NaN where the value is unknown."""
        if state is None:
            return (math.nan,) * len(self._names)
        values: list[float] = []
        for name in self._names:
            place = self._places.get(name)
            if place is not None and place < len(state.applied):
                values.append(state.applied[place])
            else:
                values.append(state.quantities.get(name, math.nan))
        return tuple(values)

    def sources(self, state: GuardState | None) -> dict[str, str]:
        """Return the source of each quantity."""
        known = {} if state is None else state.sources
        return {name: _ABSENT for name in self._measured if name not in known} | known


def build_observation(
    *,
    seq: int,
    now_ns: int,
    reader: StateReader,
    state: GuardState | None,
    newest: NumberedFrame | None,
    frame_sent: int | None,
    lease: int,
    command_ns: int | None,
    holder: ClientIdentity | None,
    mine: bool,
    commanded: tuple[float, ...] = (),
    suggested: PendingCommand | None = None,
) -> Observation:
    """Build the observation for one client.

    `frame_sent` is the number of the last frame sent to it; None if it wants no frames. A command
    of another lease than `lease` came from another client.
    """
    state_ns = now_ns if state is None else state.at_ns
    is_new = newest is not None and frame_sent is not None and newest.seq != frame_sent
    drives = state is not None and state.applied_session == lease and state.applied_seq is not None
    return Observation(
        seq=seq,
        captured_ns=state_ns if newest is None else newest.frame.captured_ns,
        state_ns=state_ns,
        sent_ns=now_ns,
        frame=newest.frame.jpeg if newest is not None and is_new else None,
        frame_seq=0 if newest is None else newest.seq,
        state=reader.values(state),
        sources=reader.sources(state),
        action_applied=() if state is None else state.applied,
        applied_seq=state.applied_seq if state is not None and drives else None,
        applied_ns=state.applied_ns if state is not None and drives else None,
        command_ns=command_ns if drives else None,
        stop_reason="The guard has not reported yet." if state is None else state.stop_reason,
        armed=state is not None and state.armed,
        emergency=state is not None and state.emergency,
        emergencies=0 if state is None else state.emergencies,
        holder="" if holder is None else holder.name,
        mine=mine,
        holder_role="" if holder is None else holder.role,
        commanded=commanded,
        suggested=() if suggested is None else suggested.values,
        suggested_by="" if suggested is None else suggested.client.name,
    )
