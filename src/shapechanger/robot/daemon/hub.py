"""Session hub: state that all connections share, commands to the guard, and the robot's time."""

from __future__ import annotations

import asyncio
import logging
import math
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Final, NamedTuple

import msgspec

from shapechanger.errors import RobotRefused
from shapechanger.layout import Layout
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client, Sent
from shapechanger.robot.daemon.library import RecordingLibrary
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.policies import PolicyRunner
from shapechanger.robot.daemon.recorder import Recorder
from shapechanger.robot.guard.channel import NO_STATE, GuardState, Order
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link import messages

_MAX_CLIENTS: Final = 8  # Most clients connected at the same time.
_MAX_PROGRAMS: Final = 6  # Most programs, so that two people can connect without displacing any.
_NS_PER_MS: Final = 1_000_000
_ARRIVALS: Final = 64  # Number of stored arrival times; fewer commands can be pending.
_APPLIED: Final = "/applied"
_ABSENT: Final = "absent"
_FRAME_WAIT_S: Final = 2.0  # Real time that a frame may spend in the camera's driver.

_log = logging.getLogger(__name__)


class PendingCommand(NamedTuple):
    """Values of a command or a suggestion, and when they expire on the robot's clock, ns."""

    client: Client
    values: tuple[float, ...]
    until_ns: int


_NOTHING: Final = PendingCommand(Client(0), (), 0)


class SessionHub:
    """State of the robot that its connections share. Its methods never block or use sockets."""

    def __init__(
        self,
        plan: DaemonPlan,
        clock: Clock,
        order: Callable[[Order], None],
        drain: Callable[[], None] = lambda: None,
        call: Callable[[Callable[[], None]], None] = lambda work: work(),
    ) -> None:
        self.plan = plan
        self.now_ns = clock.now_ns
        self.in_steps = plan.card.clock == "twin"  # Whether time only passes in calls of `step`.
        self.holder: Client | None = None  # The client in control, which holds the lease.
        # Number of the newest lease. Each lease has a larger number than the one before, so that
        # commands of an earlier lease can be recognised.
        self.lease = 0
        actions = Layout.from_json(plan.card.action_layout)
        self.action_size = actions.size  # Number of values of a command.
        self._applied = [f"{name}{_APPLIED}" for name in actions.names]
        features = Layout.from_json(plan.card.state_layout).features
        self._names = [f.name for f in features for _ in range(f.size)]
        self._absent = {f.name: _ABSENT for f in features if not f.name.endswith(_APPLIED)}
        self.state = NO_STATE  # Newest state of the guard.
        self.frame: Frame | None = None  # Newest frame.
        self.frame_seq = 0  # Number of the newest frame, from 1; 0 before the first frame.
        self._clock = clock
        self._order = order
        self._drain = drain
        self._one_step_at_a_time = asyncio.Lock()
        self._frame_arrived = asyncio.Event()
        self._unsettled = False  # Whether an order is pending until the guard's next tick.
        self._clients: dict[int, Client] = {}
        # Lease and number of each command, and when it arrived, ns.
        self._arrivals: deque[tuple[tuple[int, int], int]] = deque(maxlen=_ARRIVALS)
        self._command = self._suggestion = _NOTHING
        self.recorder = Recorder(plan, self._broadcast, call)
        self.library = RecordingLibrary(Path(plan.recordings), call)
        self.policies = PolicyRunner(plan, self._broadcast)

    @property
    def holder_name(self) -> str:
        """Name of the client in control; "" for none."""
        return "" if self.holder is None else self.holder.name

    def join(self, client: Client) -> None:
        """Add an authenticated client.

        A person is always accepted: at the limit, the oldest client without control is expelled.
        """
        programs = sum(not other.is_person for other in self._clients.values())
        is_full = len(self._clients) >= _MAX_CLIENTS
        if not client.is_person and (is_full or programs >= _MAX_PROGRAMS):
            count = f"{len(self._clients)} clients" if is_full else f"{programs} programs"
            raise RobotRefused(
                f"{count} are connected, which is the limit; only a person can still connect."
            )
        others = [other for other in self._clients.values() if other is not self.holder]
        self._clients[client.session] = client
        if is_full:
            # The person may need to stop the robot, so they are always accepted.
            others[0].expel(f"{client.name} connected, and {_MAX_CLIENTS} clients are the limit.")
            self.leave(others[0])

    def leave(self, client: Client) -> None:
        """Remove a client; if it had control, the robot stops and is disarmed."""
        if self._clients.pop(client.session, None) is None:
            return
        if self._suggestion.client is client:
            self._suggestion = _NOTHING
        self.release(client, f"the connection to {client.name} ended")
        if self.recorder.on and not any(other.is_person for other in self._clients.values()):
            self.recorder.end("The last person disconnected, which ended the recording.")
            self._broadcast(self.recorder.state())

    def take(self, client: Client) -> None:
        """Give control to a client and report it to all, or report the refusal to the client.

        A person takes control from a program at once; otherwise the client in control keeps it.
        """
        held = self.holder
        if held is not None and held is not client and (held.is_person or not client.is_person):
            reason = f"{held.name} has control; a {client.role} cannot take it from a {held.role}."
            client.post(messages.Lease(mine=False, holder=held.name, reason=reason))
            return
        if self._suggestion.client is client:
            self._suggestion = _NOTHING
        reason = f"{client.name} has control."
        if held is not client:
            self.holder = client
            self.lease += 1
            if held is not None:
                # The last command of the previous holder must not stay in force.
                self.give_order(Order(kind="halt"))
                self._command = _NOTHING
                reason = f"{client.name}, a person, took control from {held.name}."
        self._broadcast_lease(reason)

    def release(self, client: Client, why: str) -> None:
        """End the lease of a client, if it holds it, and disarm the robot."""
        if self.holder is not client:
            return
        self.holder = None
        self.give_order(Order(kind="disarm", reason=why))
        self._command = _NOTHING
        self._broadcast_lease(f"No client has control: {why}.")

    def command(self, client: Client, command: messages.Command, sent: Sent | None = None) -> None:
        """Pass a valid command of the lease holder, which answers `sent`, to the guard."""
        now_ns = self.now_ns()
        self._arrivals.append(((self.lease, command.seq), now_ns))
        values = tuple(command.scale * value for value in command.values)
        until_ns = now_ns + _NS_PER_MS * min(command.ttl_ms, self.plan.card.deadline_ms)
        self._command = PendingCommand(client, values, until_ns)
        if sent is not None and self.state.armed:
            self.recorder.decided(client, sent, values, now_ns)
        self._order(
            Order(
                kind="command",
                session=self.lease,
                seq=command.seq,
                issued_ns=now_ns,
                ttl_ms=command.ttl_ms,
                frame_ns=None if self.frame is None else self.frame.captured_ns,
                values=values,
            )
        )

    def halt(self) -> None:
        """Drop the newest command, because the lease holder sent an invalid one after it."""
        # Not by `give_order`, because `settle` would then let one more tick of time pass.
        self._command = _NOTHING
        self._order(Order(kind="halt", issued_ns=self.now_ns()))

    def give_order(self, order: Order) -> None:
        """Pass an order other than a command to the guard, with the current time."""
        self._unsettled = True
        self._order(msgspec.structs.replace(order, issued_ns=self.now_ns()))

    def suggest(self, client: Client, values: tuple[float, ...]) -> None:
        """Store the suggestion of a client without the lease."""
        until_ns = self.now_ns() + _NS_PER_MS * self.plan.card.deadline_ms
        self._suggestion = PendingCommand(client, values, until_ns)

    def observation(self, client: Client, seq: int, frame_sent: int | None) -> messages.Observation:
        """Build the observation for one client.

        `frame_sent` is the number of the last frame sent to it, or None to send no frame.
        """
        now_ns, state, frame, holder = self.now_ns(), self.state, self.frame, self.holder
        at_ns = state.at_ns or now_ns
        known = state.quantities | dict(zip(self._applied, state.applied, strict=False))
        # A command of an earlier lease is not reported: it may be another client's.
        drives = state.applied_seq is not None and state.applied_session == self.lease
        command, suggestion = (
            pending if now_ns <= pending.until_ns else _NOTHING
            for pending in (self._command if state.armed else _NOTHING, self._suggestion)
        )
        is_new = frame_sent is not None and frame_sent != self.frame_seq
        return messages.Observation(
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
            command_ns=dict(self._arrivals).get((self.lease, state.applied_seq or 0))
            if drives
            else None,
            stop_reason=state.stop_reason,
            armed=state.armed,
            emergency=state.emergency,
            emergencies=state.emergencies,
            holder=self.holder_name,
            mine=holder is client,
            holder_role="" if holder is None else holder.role,
            commanded=command.values,
            suggested=suggestion.values,
            suggested_by=suggestion.client.name,
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
            refused = messages.Refused(reason=state.refused, seq=state.refused_seq)
            if state.refused_seq is None:
                self._broadcast(refused)
            elif self.holder is not None:
                # Only the lease holder needs to learn of a refused command.
                self.holder.post(refused)
        for client in self._clients.values():
            client.updated.set()

    def on_frame(self, frame: Frame) -> None:
        """Handle a new, valid frame of the camera."""
        self.frame = frame
        self.frame_seq += 1
        self._frame_arrived.set()
        for client in self._clients.values():
            client.updated.set()

    async def step(self, seconds: float) -> None:
        """Let `seconds` of the robot's time pass, and then handle the states of the guard."""
        if self.in_steps:
            # Finish a step even if its client disconnects, so that the clock stays consistent.
            await asyncio.shield(asyncio.ensure_future(self._one_step(seconds)))
        else:
            await self._clock.sleep(seconds)
            self._drain()

    async def settle(self) -> None:
        """If time moves in steps, let the guard handle an order that was just given."""
        if self.in_steps and self._unsettled:
            self._unsettled = False
            await self.step(1.0 / self.plan.card.tick_hz)

    def event(self, name: str, text: str) -> None:
        """Report an event to all clients."""
        self._broadcast(messages.Event(name=name, text=text, at_ns=self.now_ns()))

    def _broadcast(self, message: messages.RobotMessage) -> None:
        for client in self._clients.values():
            client.post(message)

    def _broadcast_lease(self, reason: str) -> None:
        for client in self._clients.values():
            mine = self.holder is client
            client.post(messages.Lease(mine=mine, holder=self.holder_name, reason=reason))

    async def _one_step(self, seconds: float) -> None:
        async with self._one_step_at_a_time:
            captured_ns = await self._clock.sleep(seconds)
            self._drain()
            if captured_ns is None:
                return
            try:  # The frame may still be in the camera's driver.
                async with asyncio.timeout(_FRAME_WAIT_S):
                    while self.frame is None or self.frame.captured_ns < captured_ns:
                        self._frame_arrived.clear()
                        await self._frame_arrived.wait()
            except TimeoutError:
                _log.warning("The frame of %d ns did not arrive.", captured_ns)
