"""What all connections to a robot share: the command, the newest state and picture, the guard."""

from __future__ import annotations

import asyncio
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final, Protocol

from shapechanger.errors import RobotRefused
from shapechanger.layout import Layout
from shapechanger.link.messages import Command, Event, Lease, Refused, RobotMessage
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.control import (
    ClientIdentity,
    ControlLease,
    PendingCommand,
    PendingCommands,
)
from shapechanger.robot.daemon.library import RecordingLibrary
from shapechanger.robot.daemon.observation import NumberedFrame, StateReader
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.recorder import Recorder
from shapechanger.robot.guard.messages import GuardState, Order

__all__ = ["MAX_CLIENTS", "MAX_PROGRAMS", "ConnectedClient", "SessionHub"]

MAX_CLIENTS: Final = 8
"""Connections that are known at the same time."""

MAX_PROGRAMS: Final = 6
"""How many of them may be programs, so that a person finds a place to stop the robot from."""

_ARRIVALS: Final = 64  # Commands whose time of arrival is remembered; more than are on their way.


class ConnectedClient(Protocol):
    """A connection whose client is known."""

    @property
    def who(self) -> ClientIdentity:
        """Who it is."""
        ...

    def tell(self, message: RobotMessage) -> None:
        """Send a message when there is time."""
        ...

    def notice(self) -> None:
        """There is a new state or picture."""
        ...


class SessionHub:
    """The robot, as its connections see it; it waits for nothing and knows no sockets.

    Args:
        plan: What the robot is.
        now_ns: Gives the robot's time.
        order: Hands an order to the guard.
        call: Runs a function in the thread of the connections, from any other one.

    Attributes:
        plan: What the robot is.
        lease: Who commands.
        recorder: Records what is driven.
        library: Knows what was recorded.
        reader: Reads the state.
        action_size: How many numbers a command has.
        state: What the guard said last; None for nothing yet.
        newest: The newest picture; None for none yet.
        pictured: Set at each new picture, for whoever waits for one.
        unsettled: Whether an order was given that takes effect at the guard's next tick.
    """

    def __init__(
        self,
        plan: DaemonPlan,
        now_ns: Callable[[], int],
        order: Callable[[Order], None],
        call: Callable[[Callable[[], None]], None] | None = None,
    ) -> None:
        self.plan = plan
        self.lease = ControlLease()
        actions = Layout.from_json(plan.action_layout)
        self.reader = StateReader(Layout.from_json(plan.state_layout), actions)
        self.action_size = actions.size
        self.state: GuardState | None = None
        self.newest: NumberedFrame | None = None
        self.pictured = asyncio.Event()
        self.unsettled = False
        self._now_ns = now_ns
        self._order = order
        self._members: dict[int, ConnectedClient] = {}
        self._arrivals: OrderedDict[tuple[int, int], int] = OrderedDict()
        self._wishes = PendingCommands(plan.deadline_ms)
        call = _at_once if call is None else call
        self.recorder = Recorder(plan, self._tell, call)
        self.library = RecordingLibrary(Path(plan.recordings) if plan.recordings else None, call)

    def now_ns(self) -> int:
        """The robot's time."""
        return self._now_ns()

    def join(self, member: ConnectedClient) -> None:
        """Let a client in.

        Raises:
            RobotRefused: If there are too many.
        """
        programs = sum(other.who.role == "program" for other in self._members.values())
        if len(self._members) >= MAX_CLIENTS:
            raise RobotRefused(f"{MAX_CLIENTS} clients are connected already; there is no place.")
        if member.who.role == "program" and programs >= MAX_PROGRAMS:
            raise RobotRefused(
                f"{MAX_PROGRAMS} programs are connected already; the other places are for persons."
            )
        self._members[member.who.session] = member

    def leave(self, session: int) -> None:
        """A connection has ended; if it commanded, the robot stops and is disarmed."""
        member = self._members.pop(session, None)
        if member is None:
            return
        self._wishes.forget(session)
        self.release(member.who, f"the connection to {member.who.name} has ended")
        self.recorder.forget(session)
        if self.recorder.on and not any(m.who.role == "person" for m in self._members.values()):
            # Nobody is left who could end it.
            self.recorder.end("The last person has left, and recording ended with that.")
            self._tell(self.recorder.state())

    def take(self, who: ClientIdentity) -> None:
        """Give somebody the command, and tell everybody; or tell them why not."""
        refusal = self.lease.refusal(who)
        if refusal:
            held = self.lease.holder
            name = "" if held is None else held.name
            self._members[who.session].tell(Lease(mine=False, holder=name, reason=refusal))
            return
        lost = self.lease.take(who)
        self._wishes.forget(who.session)
        reason = f"{who.name} commands."
        if lost is not None:
            # What the other one said last must not act on: whoever took it wants that ended.
            self.give_order(Order(kind="halt"))
            self._wishes.end_command()
            reason = f"{who.name}, a person, took the command from {lost.name}."
        self._tell_lease(reason)

    def release(self, who: ClientIdentity, why: str) -> None:
        """Take the command from somebody who has it, and disarm."""
        if not self.lease.give_up(who.session):
            return
        self.give_order(Order(kind="disarm", reason=why))
        self._wishes.end_command()
        self._tell_lease(f"Nobody commands: {why}.")

    def command(self, command: Command, now_ns: int) -> None:
        """Hand a command that was found good to the guard."""
        key = (self.lease.number, command.seq)
        self._arrivals[key] = now_ns
        if len(self._arrivals) > _ARRIVALS:
            self._arrivals.popitem(last=False)
        values = tuple(command.scale * value for value in command.values)
        if (held := self.lease.holder) is not None:
            self._wishes.command(held, values, command.ttl_ms, now_ns)
            if self.state is not None and self.state.armed:
                self.recorder.decided(held, command.answers, values, now_ns)
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
        """Take back the newest command, because whoever commands said nonsense after it."""
        # Nobody has to wait until it takes effect: whoever said that waits for an observation.
        self._wishes.end_command()
        self._order(Order(kind="halt", issued_ns=self._now_ns()))

    def give_order(self, order: Order) -> None:
        """Hand the guard an order that is no command, with the time of now."""
        self.unsettled = True
        self._order(replace(order, issued_ns=self._now_ns()))

    def suggest(self, who: ClientIdentity, values: tuple[float, ...]) -> None:
        """Take down what somebody who does not command would do."""
        self._wishes.suggest(who, values, self._now_ns())

    def commanded(self) -> tuple[float, ...]:
        """The newest command that is in force; empty for none."""
        if self.state is None or not self.state.armed:
            return ()
        return self._wishes.commanded(self._now_ns())

    def suggested(self) -> PendingCommand | None:
        """What somebody who does not command would do; None for nothing."""
        return self._wishes.suggested(self._now_ns())

    def command_ns(self) -> int | None:
        """When the command arrived that the outputs follow now."""
        if self.state is None or self.state.applied_seq is None:
            return None
        return self._arrivals.get((self.state.applied_session, self.state.applied_seq))

    def on_state(self, state: GuardState) -> None:
        """The guard says what it does."""
        before, self.state = self.state, state
        for name, text in _happened(before, state):
            self.event(name, text)
        if state.refused:
            self._tell_refused(state)
        self._notice()

    def on_frame(self, frame: Frame) -> None:
        """The camera gave a picture that was found good and new."""
        seq = 1 if self.newest is None else self.newest.seq + 1
        self.newest = NumberedFrame(seq, frame)
        self.pictured.set()
        self._notice()

    def event(self, name: str, text: str) -> None:
        """Tell everybody that something happened."""
        self._tell(Event(name=name, text=text, at_ns=self._now_ns()))

    def _tell(self, message: RobotMessage) -> None:
        for member in list(self._members.values()):
            member.tell(message)

    def _tell_lease(self, reason: str) -> None:
        held = self.lease.holder
        name = "" if held is None else held.name
        for session, member in list(self._members.items()):
            member.tell(Lease(mine=self.lease.holds(session), holder=name, reason=reason))

    def _tell_refused(self, state: GuardState) -> None:
        """Tell whoever commands; what is no command concerns everybody."""
        refused = Refused(reason=state.refused, seq=state.refused_seq)
        held = self.lease.holder
        if state.refused_seq is None:
            self._tell(refused)
        elif held is not None and held.session in self._members:
            self._members[held.session].tell(refused)

    def _notice(self) -> None:
        for member in self._members.values():
            member.notice()


def _at_once(work: Callable[[], None]) -> None:
    """For who has one thread only."""
    work()


def _happened(before: GuardState | None, now: GuardState) -> list[tuple[str, str]]:
    """What people should know of the change from one state to the next: names and sentences."""
    happened: list[tuple[str, str]] = []
    if now.emergencies > (0 if before is None else before.emergencies):
        happened.append(("emergency", now.stop_reason or "Emergency stop."))
    if now.armed and not (before is not None and before.armed):
        happened.append(("armed", "The outputs may move."))
    if before is not None and before.armed and not now.armed:
        happened.append(("disarmed", now.stop_reason or "Disarmed."))
    if before is not None and now.bumps > before.bumps:
        happened.append(("bump", "The robot bumped into something."))
    return happened
