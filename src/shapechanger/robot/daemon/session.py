"""Session of one client: the rules for its messages, and the WebSocket that carries them."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
from collections import deque
from collections.abc import Awaitable, Callable
from time import monotonic
from typing import Final

import aiohttp
import msgspec
from aiohttp import WSMsgType, web

from shapechanger.errors import LinkError, RobotRefused, ShapechangerError, translate_errors
from shapechanger.robot.daemon.client import NOT_READING, Client, Declined, Sent
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.library import Answer
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.link import messages
from shapechanger.robot.link.authentication import new_nonce

MESSAGES_PER_S: Final = 500.0
"""Messages per second that a connection may send; a driver sends 50."""

HELLO_TIMEOUT_S: Final = 3.0
"""Time that a client has for its hello, s."""

_log = logging.getLogger(__name__)

_LARGEST_VALUE: Final = 1e6  # Prevents overflow of sums; the guard clips values to 1.
_WINDOW: Final = 64  # Observations to store: over a second at 50 Hz; older ones are stale.
_NS_PER_MS: Final = 1_000_000
_SEND_S: Final = 2.0  # A client that does not read for this long is disconnected.
_CLOSE_S: Final = 1.0
_UNANSWERED_MS: Final = 4_000  # Data that stays unacknowledged for this long ends the connection.
# A dead radio sends no data: the connection ends 6 s after it fell silent.
_HEARTBEAT_S: Final = 4.0
# A key of 128 bits cannot be guessed. The pause limits the cost of attempts for the robot, and does
# not delay a client with the right key at the same address.
_WRONG_KEY_S: Final = 0.5

# If the camera's rate is within this factor of the control rate, observations are sent at its pace,
# so that each has a new frame. The robot waits for a frame that is a little late, because an
# observation without it would use up the client's credit.
_FRAME_PACE: Final = 1.25

_BY_PERSONS: Final = (messages.Record, messages.Mark, messages.Undo, messages.Judge)
_OF_RECORDINGS: Final = (*_BY_PERSONS, messages.Browse, messages.Fetch)


def printable(text: str) -> str:
    """Return `text` as one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text).strip()


class Session:
    """Session of one client.

    `introduce`, `receive` and `observe` are the rules, without sockets; `run` serves the client on
    a WebSocket: it receives, answers, and sends observations when they are due.
    """

    def __init__(
        self,
        number: int,
        hub: SessionHub,
        authenticator: Authenticator,
        messages_per_s: float = MESSAGES_PER_S,
    ) -> None:
        self.client = Client(number)
        self._hub = hub
        self._authenticator = authenticator
        self._nonce = new_nonce()
        self._is_known = False
        self._pace: messages.Pace = "realtime"
        self._wants_frames = False
        self._credit = False  # True while the client waits for an observation.
        self._sent: deque[Sent] = deque(maxlen=_WINDOW)
        self._newest_seq = {messages.Command: -1, messages.Suggest: -1}
        self._observation_seq = 0
        self._frame_seq = 0
        self._awaits_library = False
        # A token bucket that holds one second's worth of messages.
        self._messages_per_s = self._tokens = messages_per_s
        self._counted_s = monotonic()
        # Uncompressed, and without a send queue.
        self._socket = web.WebSocketResponse(
            timeout=_CLOSE_S,
            autoping=False,  # Pings count as messages here, so that they cannot flood the robot.
            heartbeat=_HEARTBEAT_S,
            compress=False,
            # Above the limit, so that an oversized message gets an error message.
            max_msg_size=4 * messages.MAX_CLIENT_MESSAGE,
            writer_limit=0,
        )
        self._period_s = 1.0 / hub.plan.card.control_hz
        camera = hub.plan.camera
        ratio = 0.0 if camera is None else camera.fps / hub.plan.card.control_hz
        self._by_frames = 1.0 / _FRAME_PACE <= ratio <= _FRAME_PACE
        self._due_s = 0.0

    def introduce(self, data: bytes) -> messages.Welcome:
        """Authenticate the client with its first message."""
        hello = messages.decode_client_message(data)
        if not isinstance(hello, messages.Hello) or self._is_known:
            raise LinkError("The first message must be a hello.")
        if hello.version != messages.VERSION:
            raise RobotRefused(
                f"The robot uses version {messages.VERSION} of the link, and this client "
                f"{hello.version}: install the same version of shapechanger on both."
            )
        if not self._authenticator.accepts(hello, self._nonce):
            raise RobotRefused(
                "Wrong key. `shapechanger robot key NAME` shows the right one on the robot."
            )
        hub, client = self._hub, self.client
        client.role = hello.role
        client.name = printable(hello.name) or f"{hello.role} {client.session}"
        hub.join(client)
        self._is_known, self._pace, self._wants_frames = True, hello.pace, hello.frames
        if (recorded := hub.recorder.state()).episode:
            client.post(recorded)
        if hub.plan.policies:
            client.post(hub.policies.state())
        card, can_record = msgspec.structs.asdict(hub.plan.card), bool(hub.plan.recordings)
        return messages.Welcome(**card, session=client.session, can_record=can_record)

    def receive(self, data: bytes) -> None:
        """Handle a message of the client."""
        if not self._is_known:
            raise LinkError("The first message must be a hello.")
        if self.client.expelled:
            raise LinkError(self.client.expelled)
        self._count()
        message = messages.decode_client_message(data)
        try:
            self._handle(message)
        except Declined as error:
            is_numbered = isinstance(message, messages.Command | messages.Suggest)
            seq = message.seq if is_numbered else None
            self.client.post(messages.Refused(reason=str(error), seq=seq))

    def _handle(self, message: messages.ClientMessage) -> None:
        hub, client = self._hub, self.client
        match message:
            case messages.Command() | messages.Suggest():
                self._receive_values(message)
            case messages.Acknowledge():
                self._give_credit()
            case messages.Take():
                hub.take(client)
            case messages.Release():
                hub.release(client, f"{client.name} released it")
            case messages.Arm():
                self._arm(message)
            case messages.Disarm():
                if not client.is_person and hub.holder is not client:
                    raise Declined(
                        "Only the client in control, or a person, can disarm this robot; any "
                        "client can stop it with an emergency stop."
                    )
                hub.give_order(Order(kind="disarm", reason=f"{client.name} disarmed"))
            case messages.EmergencyStop():
                reason = f"{client.name}: {printable(message.reason) or 'stop'}"
                hub.give_order(Order(kind="emergency", reason=reason))
            case messages.Ping():
                client.post(messages.Pong(token=message.token, now_ns=hub.now_ns()))
            case messages.RunPolicy():
                if not client.is_person:
                    raise Declined("Only a person can start a policy on this robot, or end it.")
                hub.policies.run(message.policy)
            case _ if isinstance(message, _BY_PERSONS) and not client.is_person:
                raise Declined("Only a person can record on this robot, and judge recordings.")
            case _ if isinstance(message, _OF_RECORDINGS) and not hub.plan.recordings:
                raise Declined("This robot was served without a folder for recordings.")
            case messages.Record(on=False):
                hub.recorder.end()
            case messages.Record():
                hub.recorder.begin(client, printable(message.name), hub.holder_name)
            case messages.Mark():
                hub.recorder.edit(messages.Mark(text=printable(message.text)), client)
            case messages.Undo():
                hub.recorder.edit(message, client)
            case messages.Browse() | messages.Fetch() | messages.Judge():
                # An answer may be large, so the next request is accepted once it has been sent.
                if self._awaits_library or client.awaits(messages.Recordings, messages.Piece):
                    raise Declined("Send one request about recordings at a time.")
                self._awaits_library = True
                hub.library.ask(message, self._library_answered)
            case _:
                raise LinkError("The hello was sent already.")

    def observe(self) -> messages.Observation:
        """Build the observation to send now, and use up the credit for it."""
        hub = self._hub
        self._observation_seq += 1
        frame_sent = self._frame_seq if self._wants_frames else None
        observation = hub.observation(self.client, self._observation_seq, frame_sent)
        self._sent.append(Sent(observation, hub.frame))
        hub.recorder.observed(self.client, observation)
        if observation.frame is not None:
            self._frame_seq = observation.frame_seq
        if self._pace == "lockstep":  # The robot sets the pace, so the client cannot flood it.
            self._tokens = min(self._messages_per_s, self._tokens + 1.0)
        self._credit = False
        return observation

    def _count(self) -> None:
        now_s = monotonic()
        gained = (now_s - self._counted_s) * self._messages_per_s
        self._tokens = min(self._messages_per_s, self._tokens + gained)
        self._counted_s = now_s
        if self._tokens < 1.0:
            raise RobotRefused(f"Too many messages: {MESSAGES_PER_S:.0f} per second are allowed.")
        self._tokens -= 1.0

    def _give_credit(self) -> None:
        self._credit = True
        self.client.updated.set()

    def _receive_values(self, message: messages.Command | messages.Suggest) -> None:
        """Handle a command or a suggestion; either requests the next observation."""
        hub, kind, is_command = self._hub, type(message), isinstance(message, messages.Command)
        newest = self._newest_seq[kind]
        self._newest_seq[kind] = max(newest, message.seq)
        self._give_credit()
        if is_command and hub.holder is not self.client:
            raise Declined("You do not have control; take it first.")
        if not is_command and hub.holder is self.client:
            raise Declined("You have control: send a command instead of a suggestion.")
        if message.seq <= newest:
            name = "Command" if is_command else "Suggestion"
            raise Declined(f"{name} {message.seq} is not newer than {newest}.")
        fault = ""
        if len(message.values) != hub.action_size:
            fault = (
                f"A command of this robot has {hub.action_size} values, got {len(message.values)}."
            )
        elif not all(math.isfinite(v) and abs(v) <= _LARGEST_VALUE for v in message.values):
            fault = f"The values of a command must be finite and within ±{_LARGEST_VALUE:g}."
        if fault:
            # An invalid command supersedes the previous command. A late or repeated command does
            # not, and must not stop a newer command.
            if is_command:
                hub.halt()
            raise Declined(fault)
        sent = self._answered(message.answers)
        if isinstance(message, messages.Command):
            hub.command(self.client, message, sent)
        else:
            hub.suggest(self.client, message.values)

    def _answered(self, seq: int, result: str = "") -> Sent:
        """Return the observation that a message answers; raise `Declined` if it is too old."""
        sent = next((sent for sent in self._sent if sent.observation.seq == seq), None)
        if sent is None:
            raise Declined(f"{result}Observation {seq} was not sent to this client recently.")
        age_ms = (self._hub.now_ns() - sent.observation.sent_ns) / _NS_PER_MS
        most_ms = self._hub.plan.card.max_observation_age_ms
        if age_ms > most_ms:
            raise Declined(
                f"{result}Observation {seq} was sent {age_ms:.0f} ms ago; "
                f"at most {most_ms} ms are allowed."
            )
        return sent

    def _arm(self, arm: messages.Arm) -> None:
        hub, person = self._hub, self.client.is_person
        if hub.holder is None:
            raise Declined("No client has control; take control first.")
        if not person and hub.plan.card.arming != "anyone":
            raise Declined("Only a person can arm this robot.")
        if not person and hub.state.emergency:
            raise Declined("Only a person can end an emergency stop.")
        if not person and hub.holder is not self.client:
            raise Declined("Only the client in control, or a person, can arm this robot.")
        self._answered(arm.answers, "Not armed. ")
        # Only the guard has counted all emergency stops, so it compares the number in `arm`.
        hub.give_order(Order(kind="arm", emergency=arm.emergency, person=person))

    def _library_answered(self, answer: Answer) -> None:
        self._awaits_library = False
        self.client.post(answer)

    async def run(
        self, request: web.Request, on_known: Callable[[], object]
    ) -> web.WebSocketResponse:
        """Serve the client until it disconnects; call `on_known` once it has authenticated."""
        await self._socket.prepare(request)
        client = self.client
        reason: ShapechangerError | None = None
        try:
            _tune(request.transport)
            await self._greet()
            on_known()
            _log.info("%s, a %s, connected from %s.", client.name, client.role, request.remote)
            await self._exchange()
            _log.info("%s disconnected.", client.name)
        except ShapechangerError as error:
            reason = error
            if isinstance(error, RobotRefused) and not self._is_known:
                await asyncio.sleep(_WRONG_KEY_S)
        finally:
            # If this client was in control, stop the robot first.
            self._hub.leave(client)
        if reason is not None:
            _log.info("%s: %s", client.name or request.remote, reason)
            with contextlib.suppress(LinkError):  # The client may no longer read.
                await self._send(messages.Refused(reason=str(reason), fatal=True))
        await self._hub.settle()
        try:
            async with asyncio.timeout(2 * _CLOSE_S):
                await self._socket.close(code=aiohttp.WSCloseCode.OK, drain=False)
        except (TimeoutError, ConnectionError, RuntimeError):
            _log.info("The connection of %s was cut.", client.name or "a client")
        return self._socket

    async def _greet(self) -> None:
        await self._send(
            messages.Challenge(
                version=messages.VERSION, nonce=self._nonce, robot=self._hub.plan.card.robot
            )
        )
        late = LinkError(f"No hello was received within {HELLO_TIMEOUT_S:.0f} s.")
        with translate_errors(TimeoutError, to=lambda _: late):
            async with asyncio.timeout(HELLO_TIMEOUT_S):
                data = await self._read()
        if data is None:
            raise LinkError("The client left without a hello.")
        await self._send(self.introduce(data))

    async def _exchange(self) -> None:
        try:
            async with asyncio.TaskGroup() as group:
                others = [group.create_task(work) for work in (self._answer(), self._observe())]
                while (data := await self._read()) is not None:
                    self.receive(data)
                    await self._hub.settle()
                    if self.client.awaits():
                        await asyncio.sleep(0)  # Let other tasks run; requests may come very fast.
                for task in others:
                    task.cancel()
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None

    async def _send(self, message: messages.RobotMessage) -> None:
        await self._in_time(self._socket.send_bytes(messages.encode(message)))

    async def _in_time(self, sending: Awaitable[None]) -> None:
        with (
            translate_errors(TimeoutError, to=lambda _: LinkError(NOT_READING)),
            translate_errors(ConnectionError, RuntimeError, to=_ended),
        ):
            async with asyncio.timeout(_SEND_S):
                await sending

    async def _answer(self) -> None:
        client = self.client
        while True:
            await client.posted.wait()
            client.posted.clear()
            while (message := client.take()) is not None:
                await self._send(message)
            if client.expelled:
                raise LinkError(client.expelled)

    async def _observe(self) -> None:
        """Send each observation once it is due and the client has credit for it."""
        hub = self._hub
        while True:
            while not self._credit:
                self.client.updated.clear()
                await self.client.updated.wait()
            # If time moves in steps, the lease holder advances it; without one, any client does.
            can_step = hub.holder in (None, self.client)
            advances = can_step if hub.in_steps else self._pace == "lockstep"
            if advances:
                await hub.step(self._period_s)
            if not advances or self._pace == "realtime":
                await self._wait_until_due()
            await self._send(self.observe())

    async def _wait_until_due(self) -> None:
        """Wait until the next observation is due, or for a new frame if frames set the pace."""
        loop, hub = asyncio.get_running_loop(), self._hub
        waits_for_frame = self._by_frames and self._wants_frames
        while not (waits_for_frame and hub.frame_seq != self._frame_seq) and (
            loop.time() < self._due_s
        ):
            self.client.updated.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(self._due_s):
                    await self.client.updated.wait()
        now_s = loop.time()
        if self._by_frames and hub.frame is not None:
            self._due_s = now_s + _FRAME_PACE * self._period_s
        else:
            # Count from the due time, so that delays do not add up. After a long silence of the
            # client, count from now, to avoid a burst of observations.
            was_s = self._due_s if now_s - self._due_s < self._period_s else now_s
            self._due_s = was_s + self._period_s

    async def _read(self) -> bytes | None:
        """Return the next message, or None when the client has disconnected."""
        while True:
            message = await self._socket.receive()
            match message.type:
                case WSMsgType.BINARY:
                    return message.data
                case WSMsgType.PING:
                    self._count()
                    await self._in_time(self._socket.pong(message.data))
                case WSMsgType.PONG:
                    self._count()
                case WSMsgType.TEXT:
                    raise LinkError("The link takes binary messages, got text.")
                case WSMsgType.ERROR:
                    raise LinkError(f"The message cannot be read: {message.data}.")
                case _:
                    return None


def _ended(error: ConnectionError | RuntimeError) -> LinkError:
    return LinkError(f"The connection ended: {error}")


def _tune(transport: asyncio.Transport | None) -> None:
    """Disable delays, limit buffers, and detect when the other end has disconnected."""
    if transport is None:
        raise LinkError("The connection ended.")
    # With `high=0`, asyncio's TLS would report an empty buffer as full every second time, and a
    # message would only count as sent when the next message is sent.
    transport.set_write_buffer_limits(high=1, low=0)
    accepted = transport.get_extra_info("socket")
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
