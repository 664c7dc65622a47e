"""Session hub: state that all connections share, and the path of commands to the guard."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final, Protocol

from shapechanger.errors import RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.control import (
    ClientIdentity,
    ControlLease,
    NumberedFrame,
    PendingCommand,
    StateReader,
)
from shapechanger.robot.daemon.library import RecordingLibrary
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.policies import PolicyRunner
from shapechanger.robot.daemon.recorder import Recorder
from shapechanger.robot.guard.messages import GuardState, Order
from shapechanger.robot.link.messages import Command, Event, Lease, Refused, RobotMessage

_MAX_CLIENTS: Final = 8
"""Most clients connected at the same time."""

_MAX_PROGRAMS: Final = 6
"""Most programs among them, so that two people can connect without displacing anyone."""

_NS_PER_MS: Final = 1_000_000
_ARRIVALS: Final = 64  # Arrival times to remember; more than commands can be under way.


class HubClient(Protocol):
    """A connected client, as the hub reaches it.

    Attributes:
        client: Its identity.
        updated: Set when an observation may be due.
    """

    client: ClientIdentity
    updated: asyncio.Event

    def post(self, message: RobotMessage) -> None:
        """Send a message."""
        ...

    def expel(self, reason: str) -> None:
        """End the connection, for a reason that is a sentence."""
        ...


class SessionHub:
    """The robot, as its connections see it. The hub never blocks and knows no sockets.

    Attributes:
        plan: Description of the robot.
        now_ns: Returns the robot's time, ns.
        lease: The control lease.
        recorder: Records episodes.
        library: Reads recorded episodes.
        policies: Runs policies on board.
        reader: Reads the guard's state in the order of the layout.
        action_size: Number of values of a command.
        state: Newest state of the guard, or None.
        newest: Newest frame, or None.
        frame_arrived: Set at each new frame.
        unsettled: True if an order was given that takes effect at the guard's next tick.
    """

    def __init__(
        self,
        plan: DaemonPlan,
        now_ns: Callable[[], int],
        order: Callable[[Order], None],
        call: Callable[[Callable[[], None]], None] = lambda work: work(),
    ) -> None:
        self.plan = plan
        self.lease = ControlLease()
        actions = Layout.from_json(plan.card.action_layout)
        self.reader = StateReader(Layout.from_json(plan.card.state_layout), actions)
        self.action_size = actions.size
        self.state: GuardState | None = None
        self.newest: NumberedFrame | None = None
        self.frame_arrived = asyncio.Event()
        self.unsettled = False
        self.now_ns = now_ns
        self._order = order
        self._clients: dict[int, HubClient] = {}
        self._arrivals: OrderedDict[tuple[int, int], int] = OrderedDict()
        self._command: PendingCommand | None = None
        self._suggestion: PendingCommand | None = None
        self.recorder = Recorder(plan, self._broadcast, call)
        self.library = RecordingLibrary(Path(plan.recordings) if plan.recordings else None, call)
        self.policies = PolicyRunner(plan, self._broadcast)

    def join(self, member: HubClient) -> None:
        """Add the session of an authenticated client.

        A person always fits: where the limit is reached, the oldest client without control leaves.
        """
        is_program = member.client.role == "program"
        programs = sum(other.client.role == "program" for other in self._clients.values())
        is_full = len(self._clients) >= _MAX_CLIENTS
        if is_program and (is_full or programs >= _MAX_PROGRAMS):
            count = f"{len(self._clients)} clients" if is_full else f"{programs} programs"
            raise RobotRefused(
                f"{count} are connected, which is the limit; only a person can still connect."
            )
        self._clients[member.client.session] = member
        if is_full:
            # The person may want to stop the robot, and the others may be of somebody who does not.
            oldest = next(n for n in self._clients if not self.lease.holds(n))
            self._clients[oldest].expel(
                f"{member.client.name} connected, and {_MAX_CLIENTS} clients are the limit."
            )
            self.leave(oldest)

    def leave(self, session: int) -> None:
        """Remove a client; if it had control, the robot stops and is disarmed."""
        member = self._clients.pop(session, None)
        if member is None:
            return
        self._drop_suggestion(session)
        self.release(member.client, f"the connection to {member.client.name} ended")
        people = any(other.client.role == "person" for other in self._clients.values())
        if self.recorder.builder is not None:
            self.recorder.builder.forget(session)
        if self.recorder.on and not people:
            self.recorder.end("The last person disconnected, which ended the recording.")
            self._broadcast(self.recorder.state())

    def take(self, client: ClientIdentity) -> None:
        """Give control to a client and report it to all, or report the refusal to the client."""
        refusal = self.lease.refusal(client)
        if refusal:
            lease = Lease(mine=False, holder=self.lease.holder_name, reason=refusal)
            self._clients[client.session].post(lease)
            return
        lost = self.lease.take(client)
        self._drop_suggestion(client.session)
        reason = f"{client.name} has control."
        if lost is not None:
            # The last command of the previous holder must not stay in force.
            self.give_order(Order(kind="halt"))
            self._command = None
            reason = f"{client.name}, a person, took control from {lost.name}."
        self._broadcast_lease(reason)

    def release(self, client: ClientIdentity, why: str) -> None:
        """End the lease of a client, if it holds it, and disarm the robot."""
        if not self.lease.release(client.session):
            return
        self.give_order(Order(kind="disarm", reason=why))
        self._command = None
        self._broadcast_lease(f"No client has control: {why}.")

    def command(self, client: ClientIdentity, command: Command, now_ns: int) -> None:
        """Pass a valid command of the lease holder to the guard."""
        self._arrivals[self.lease.number, command.seq] = now_ns
        if len(self._arrivals) > _ARRIVALS:
            self._arrivals.popitem(last=False)
        values = tuple(command.scale * value for value in command.values)
        until_ns = now_ns + _NS_PER_MS * min(command.ttl_ms, self.plan.card.deadline_ms)
        self._command = PendingCommand(client, values, until_ns)
        builder = self.recorder.builder
        if builder is not None and self.state is not None and self.state.armed:
            builder.decided(client, command.answers, values, now_ns)
        self._order(
            Order(
                kind="command",
                session=self.lease.number,
                seq=command.seq,
                issued_ns=now_ns,
                ttl_ms=command.ttl_ms,
                frame_ns=None if self.newest is None else self.newest.frame.captured_ns,
                values=values,
            )
        )

    def halt(self) -> None:
        """Drop the newest command, because the lease holder sent an invalid one after it."""
        # Not `give_order`: the sender waits for an observation anyway, so time need not step.
        self._command = None
        self._order(Order(kind="halt", issued_ns=self.now_ns()))

    def give_order(self, order: Order) -> None:
        """Pass an order other than a command to the guard, with the current time."""
        self.unsettled = True
        self._order(replace(order, issued_ns=self.now_ns()))

    def suggest(self, client: ClientIdentity, values: tuple[float, ...]) -> None:
        """Store the suggestion of a client without the lease."""
        until_ns = self.now_ns() + _NS_PER_MS * self.plan.card.deadline_ms
        self._suggestion = PendingCommand(client, values, until_ns)

    def commanded(self) -> tuple[float, ...]:
        """Return the values of the command in force, or () without one."""
        command = self._command
        if command is None or self.state is None or not self.state.armed:
            return ()
        return command.values if self.now_ns() <= command.until_ns else ()

    def suggested(self) -> PendingCommand | None:
        """Return the unexpired suggestion, or None."""
        pending = self._suggestion
        return None if pending is None or self.now_ns() > pending.until_ns else pending

    def command_ns(self) -> int | None:
        """Return the arrival time of the command that the outputs follow, ns, or None."""
        if self.state is None or self.state.applied_seq is None:
            return None
        return self._arrivals.get((self.state.applied_session, self.state.applied_seq))

    def on_state(self, state: GuardState) -> None:
        """Handle a new state of the guard."""
        before, self.state = self.state, state
        if state.emergencies > (0 if before is None else before.emergencies):
            self.event("emergency", state.stop_reason or "Emergency stop.")
        if state.armed and not (before is not None and before.armed):
            self.event("armed", "Armed.")
        if before is not None and before.armed and not state.armed:
            self.event("disarmed", state.stop_reason or "Disarmed.")
        if before is not None and state.bumps > before.bumps:
            self.event("bump", "The robot bumped into something.")
        if state.refused:
            # A refused command is the business of the lease holder alone.
            refused = Refused(reason=state.refused, seq=state.refused_seq)
            held = self.lease.holder
            if state.refused_seq is None:
                self._broadcast(refused)
            elif held is not None and held.session in self._clients:
                self._clients[held.session].post(refused)
        self._notify()

    def on_frame(self, frame: Frame) -> None:
        """Handle a new, valid frame of the camera."""
        seq = 1 if self.newest is None else self.newest.seq + 1
        self.newest = NumberedFrame(seq, frame)
        self.frame_arrived.set()
        self._notify()

    def event(self, name: str, text: str) -> None:
        """Report an event to all clients."""
        self._broadcast(Event(name=name, text=text, at_ns=self.now_ns()))

    def _broadcast(self, message: RobotMessage) -> None:
        for member in list(self._clients.values()):
            member.post(message)

    def _broadcast_lease(self, reason: str) -> None:
        for session, member in list(self._clients.items()):
            mine = self.lease.holds(session)
            member.post(Lease(mine=mine, holder=self.lease.holder_name, reason=reason))

    def _drop_suggestion(self, session: int) -> None:
        """Drop the suggestion of a client that left or took the lease."""
        if self._suggestion is not None and self._suggestion.client.session == session:
            self._suggestion = None

    def _notify(self) -> None:
        for member in self._clients.values():
            member.updated.set()
