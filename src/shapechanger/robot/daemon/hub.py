"""Session hub: state that all connections share, and the path of commands to the guard."""

from __future__ import annotations

import asyncio
import logging
import math
from collections import OrderedDict
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from shapechanger.errors import RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client, ControlLease
from shapechanger.robot.daemon.library import RecordingLibrary
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.policies import PolicyRunner
from shapechanger.robot.daemon.recorder import Recorder
from shapechanger.robot.guard.channel import NO_STATE, GuardState, Order
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link.messages import (
    Command,
    Event,
    Lease,
    Observation,
    Refused,
    RobotMessage,
)

_MAX_CLIENTS: Final = 8
"""Most clients connected at the same time."""

_MAX_PROGRAMS: Final = 6
"""Most programs among them, so that two people can connect without displacing anyone."""

_NS_PER_MS: Final = 1_000_000
_ARRIVALS: Final = 64  # Arrival times to remember; more than commands can be under way.
_APPLIED: Final = "/applied"
_ABSENT: Final = "absent"
_FRAME_WAIT_S: Final = 2.0  # Real time that a frame may spend in the camera's driver.

_log = logging.getLogger(__name__)


class PendingCommand(NamedTuple):
    """Values of a command or a suggestion, and when they expire on the robot's clock, ns."""

    client: Client
    values: tuple[float, ...]
    until_ns: int


class SessionHub:
    """The robot, as its connections see it. The hub never blocks and knows no sockets.

    Attributes:
        plan: Description of the robot.
        now_ns: Returns the robot's time, ns.
        lease: The control lease.
        recorder: Records episodes.
        library: Reads recorded episodes.
        policies: Runs policies on board.
        action_size: Number of values of a command.
        state: Newest state of the guard.
        frame: Newest frame, or None.
        frame_seq: Its number, from 1; 0 before the first.
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
        self.action_size = actions.size
        self._applied = [f"{name}{_APPLIED}" for name in actions.names]
        features = Layout.from_json(plan.card.state_layout).features
        self._names = [f.name for f in features for _ in range(f.size)]
        self._absent = {f.name: _ABSENT for f in features if not f.name.endswith(_APPLIED)}
        self.state = NO_STATE
        self.frame: Frame | None = None
        self.frame_seq = 0
        self.frame_arrived = asyncio.Event()
        self.unsettled = False
        self.now_ns = now_ns
        self._order = order
        self._clients: dict[int, Client] = {}
        self._arrivals: OrderedDict[tuple[int, int], int] = OrderedDict()
        self._command: PendingCommand | None = None
        self._suggestion: PendingCommand | None = None
        self.recorder = Recorder(plan, self._broadcast, call)
        self.library = RecordingLibrary(Path(plan.recordings) if plan.recordings else None, call)
        self.policies = PolicyRunner(plan, self._broadcast)

    def join(self, client: Client) -> None:
        """Add an authenticated client.

        A person always fits: where the limit is reached, the oldest client without control leaves.
        """
        programs = sum(not other.is_person for other in self._clients.values())
        is_full = len(self._clients) >= _MAX_CLIENTS
        if not client.is_person and (is_full or programs >= _MAX_PROGRAMS):
            count = f"{len(self._clients)} clients" if is_full else f"{programs} programs"
            raise RobotRefused(
                f"{count} are connected, which is the limit; only a person can still connect."
            )
        others = [other for other in self._clients.values() if other is not self.lease.holder]
        self._clients[client.session] = client
        if is_full:
            # The person may want to stop the robot, and the others may be of somebody who does not.
            others[0].expel(f"{client.name} connected, and {_MAX_CLIENTS} clients are the limit.")
            self.leave(others[0])

    def leave(self, client: Client) -> None:
        """Remove a client; if it had control, the robot stops and is disarmed."""
        if self._clients.pop(client.session, None) is None:
            return
        self._drop_suggestion(client)
        self.release(client, f"the connection to {client.name} ended")
        if self.recorder.builder is not None:
            self.recorder.builder.forget(client)
        if self.recorder.on and not any(other.is_person for other in self._clients.values()):
            self.recorder.end("The last person disconnected, which ended the recording.")
            self._broadcast(self.recorder.state())

    def take(self, client: Client) -> None:
        """Give control to a client and report it to all, or report the refusal to the client."""
        if refusal := self.lease.refusal(client):
            client.post(Lease(mine=False, holder=self.lease.holder_name, reason=refusal))
            return
        lost = self.lease.take(client)
        self._drop_suggestion(client)
        reason = f"{client.name} has control."
        if lost is not None:
            # The last command of the previous holder must not stay in force.
            self.give_order(Order(kind="halt"))
            self._command = None
            reason = f"{client.name}, a person, took control from {lost.name}."
        self._broadcast_lease(reason)

    def release(self, client: Client, why: str) -> None:
        """End the lease of a client, if it holds it, and disarm the robot."""
        if self.lease.holder is not client:
            return
        self.lease.holder = None
        self.give_order(Order(kind="disarm", reason=why))
        self._command = None
        self._broadcast_lease(f"No client has control: {why}.")

    def command(self, client: Client, command: Command, now_ns: int) -> None:
        """Pass a valid command of the lease holder to the guard."""
        self._arrivals[self.lease.number, command.seq] = now_ns
        if len(self._arrivals) > _ARRIVALS:
            self._arrivals.popitem(last=False)
        values = tuple(command.scale * value for value in command.values)
        until_ns = now_ns + _NS_PER_MS * min(command.ttl_ms, self.plan.card.deadline_ms)
        self._command = PendingCommand(client, values, until_ns)
        if self.recorder.builder is not None and self.state.armed:
            self.recorder.builder.decided(client, command.answers, values, now_ns)
        self._order(
            Order(
                kind="command",
                session=self.lease.number,
                seq=command.seq,
                issued_ns=now_ns,
                ttl_ms=command.ttl_ms,
                frame_ns=None if self.frame is None else self.frame.captured_ns,
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
        self._order(msgspec.structs.replace(order, issued_ns=self.now_ns()))

    def suggest(self, client: Client, values: tuple[float, ...]) -> None:
        """Store the suggestion of a client without the lease."""
        until_ns = self.now_ns() + _NS_PER_MS * self.plan.card.deadline_ms
        self._suggestion = PendingCommand(client, values, until_ns)

    def observation(self, client: Client, seq: int, frame_sent: int | None) -> Observation:
        """Build the observation for one client.

        `frame_sent` is the number of the last frame sent to it; None if it wants no frames.
        """
        now_ns, state, frame, holder = self.now_ns(), self.state, self.frame, self.lease.holder
        at_ns = state.at_ns or now_ns
        known = state.quantities | dict(zip(self._applied, state.applied, strict=False))
        # A command of another lease came from another client.
        drives = state.applied_seq is not None and state.applied_session == self.lease.number
        command, suggestion = self._command, self._suggestion
        in_force = command is not None and state.armed and now_ns <= command.until_ns
        if suggestion is not None and now_ns > suggestion.until_ns:
            suggestion = None
        is_new = frame_sent is not None and frame_sent != self.frame_seq
        return Observation(
            seq=seq,
            captured_ns=at_ns if frame is None else frame.captured_ns,
            state_ns=at_ns,
            sent_ns=now_ns,
            frame=frame.jpeg if frame is not None and is_new else None,
            frame_seq=self.frame_seq,
            state=tuple(known.get(name, math.nan) for name in self._names),
            sources=self._absent | state.sources,
            action_applied=state.applied,
            applied_seq=state.applied_seq if drives else None,
            applied_ns=state.applied_ns if drives else None,
            command_ns=self._arrivals.get((state.applied_session, state.applied_seq or 0))
            if drives
            else None,
            stop_reason=state.stop_reason,
            armed=state.armed,
            emergency=state.emergency,
            emergencies=state.emergencies,
            holder=self.lease.holder_name,
            mine=holder is client,
            holder_role="" if holder is None else holder.role,
            commanded=command.values if command is not None and in_force else (),
            suggested=() if suggestion is None else suggestion.values,
            suggested_by="" if suggestion is None else suggestion.client.name,
        )

    def on_state(self, state: GuardState) -> None:
        """Handle a new state of the guard."""
        before, self.state = self.state, state
        if state.emergencies > before.emergencies:
            self.event("emergency", state.stop_reason or "Emergency stop.")
        if state.armed and not before.armed:
            self.event("armed", "Armed.")
        if before.armed and not state.armed:
            self.event("disarmed", state.stop_reason or "Disarmed.")
        if before.at_ns and state.bumps > before.bumps:
            self.event("bump", "The robot bumped into something.")
        if state.refused:
            refused = Refused(reason=state.refused, seq=state.refused_seq)
            if state.refused_seq is None:
                self._broadcast(refused)
            elif self.lease.holder is not None:
                # A refused command is the business of the lease holder alone.
                self.lease.holder.post(refused)
        self._notify()

    def on_frame(self, frame: Frame) -> None:
        """Handle a new, valid frame of the camera."""
        self.frame = frame
        self.frame_seq += 1
        self.frame_arrived.set()
        self._notify()

    def event(self, name: str, text: str) -> None:
        """Report an event to all clients."""
        self._broadcast(Event(name=name, text=text, at_ns=self.now_ns()))

    def _broadcast(self, message: RobotMessage) -> None:
        for client in self._clients.values():
            client.post(message)

    def _broadcast_lease(self, reason: str) -> None:
        for client in self._clients.values():
            mine = self.lease.holder is client
            client.post(Lease(mine=mine, holder=self.lease.holder_name, reason=reason))

    def _drop_suggestion(self, client: Client) -> None:
        """Drop the suggestion of a client that left or took the lease."""
        if self._suggestion is not None and self._suggestion.client is client:
            self._suggestion = None

    def _notify(self) -> None:
        for client in self._clients.values():
            client.updated.set()


class Timekeeper:
    """Advances the robot's time, and collects all that happened meanwhile.

    Attributes:
        in_steps: True if time stands still between calls of `step`.
    """

    def __init__(self, clock: Clock, hub: SessionHub, drain: Callable[[], None]) -> None:
        self._clock = clock
        self._hub = hub
        self._drain = drain
        self.in_steps = hub.plan.card.clock == "twin"
        self._one_at_a_time = asyncio.Lock()

    async def step(self, seconds: float) -> None:
        """Let `seconds` pass."""
        if not self.in_steps:
            await self._clock.sleep(seconds)
            self._drain()
            return
        # Finish a step whose client disconnects: the clock would lose count otherwise.
        await asyncio.shield(asyncio.ensure_future(self._one_step(seconds)))

    async def settle(self) -> None:
        """Let the guard handle an order that was just given; a real clock needs no help."""
        if self.in_steps and self._hub.unsettled:
            self._hub.unsettled = False
            await self.step(1.0 / self._hub.plan.card.tick_hz)

    async def _one_step(self, seconds: float) -> None:
        async with self._one_at_a_time:
            captured_ns = await self._clock.sleep(seconds)
            self._drain()
            if captured_ns is not None:
                await self._wait_for_frame(captured_ns)

    async def _wait_for_frame(self, captured_ns: int) -> None:
        """Wait for a frame that is still in the camera's driver."""
        hub = self._hub
        try:
            async with asyncio.timeout(_FRAME_WAIT_S):
                while hub.frame is None or hub.frame.captured_ns < captured_ns:
                    hub.frame_arrived.clear()
                    await hub.frame_arrived.wait()
        except TimeoutError:
            _log.warning("The frame of %d ns did not arrive.", captured_ns)
