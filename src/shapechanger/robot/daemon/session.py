"""Session of one client: bytes in, messages out; and the WebSocket that carries them."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import socket
from collections.abc import Awaitable, Callable
from typing import Final

import aiohttp
import msgspec
from aiohttp import WSMsgType, web

from shapechanger.errors import LinkError, RobotRefused, ShapechangerError, translate_errors
from shapechanger.robot.daemon.client import (
    MESSAGES_PER_S,
    Client,
    MessageRate,
    SentObservations,
)
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub, Timekeeper
from shapechanger.robot.daemon.library import Answer, Question
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.link import messages
from shapechanger.robot.link.authentication import new_nonce

HELLO_TIMEOUT_S: Final = 3.0
"""Time that a client has for its hello, s."""

_NOT_READING: Final = "The client does not read its messages."

_log = logging.getLogger(__name__)

_LARGEST_VALUE: Final = 1e6  # The guard clips to 1 in any case; this keeps sums from overflowing.
_SEND_S: Final = 2.0  # A client that does not read for so long is disconnected.
_CLOSE_S: Final = 1.0
_UNANSWERED_MS: Final = 4_000  # Unacknowledged data then ends the connection.
# A dead radio sends nothing: the connection ends 6 s after it fell silent.
_HEARTBEAT_S: Final = 4.0
# A key of 128 bits cannot be guessed. The pause keeps an attempt from costing the robot more than
# its sender, and does not delay a client with the right key at the same address.
_WRONG_KEY_S: Final = 0.5

# A camera that is about as fast as the commands sets the pace, so that each observation has a new
# frame. It is worth waiting for a frame that is a little late: an observation without it would use
# up the client's credit.
_FRAME_PACE: Final = 1.25


class WrongKey(RobotRefused):
    """The client does not hold the key."""


def printable(text: str) -> str:
    """Return `text` as one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text).strip()


class Session:
    """Session of one client, without its socket.

    Attributes:
        client: Identity of the client, and the messages for it other than observations.
        credit: True while the client waits for an observation.
        pace: Whether the robot's clock or the client sets the pace.
    """

    def __init__(
        self,
        number: int,
        hub: SessionHub,
        authenticator: Authenticator,
        rate: MessageRate | None = None,
    ) -> None:
        self.client = Client(number)
        self.credit = False
        self.pace: messages.Pace = "realtime"
        self._hub = hub
        self._authenticator = authenticator
        self._rate = MessageRate() if rate is None else rate
        self._nonce = new_nonce()
        self._is_known = False
        self._wants_frames = False
        self._sent = SentObservations(hub.plan.card.max_observation_age_ms)
        self._command_seq = -1
        self._suggestion_seq = -1
        self._observation_seq = 0
        self._frame_seq = 0
        self._awaits_library = False

    @property
    def has_new_frame(self) -> bool:
        """True if there is a frame that the client wants and has not been sent."""
        return self._wants_frames and self._hub.frame_seq != self._frame_seq

    def challenge(self) -> messages.Challenge:
        """Return the first message to the client."""
        return messages.Challenge(
            version=messages.VERSION, nonce=self._nonce, robot=self._hub.plan.card.robot
        )

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
            raise WrongKey(
                "Wrong key. `shapechanger robot key NAME` shows the right one on the robot."
            )
        hub, client = self._hub, self.client
        client.role = hello.role
        client.name = printable(hello.name) or f"{hello.role} {client.session}"
        hub.join(client)
        self._is_known, self.pace, self._wants_frames = True, hello.pace, hello.frames
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
        self.count()
        message = messages.decode_client_message(data)
        match message:
            case messages.Command():
                self._command(message)
            case messages.Acknowledge():
                self._give_credit()
            case messages.Take():
                self._hub.take(self.client)
            case messages.Release():
                self._hub.release(self.client, f"{self.client.name} released it")
            case messages.Arm():
                self._arm(message)
            case messages.Disarm():
                self._disarm()
            case messages.EmergencyStop():
                reason = f"{self.client.name}: {printable(message.reason) or 'stop'}"
                self._hub.give_order(Order(kind="emergency", reason=reason))
            case messages.Ping():
                self.client.post(messages.Pong(token=message.token, now_ns=self._hub.now_ns()))
            case messages.Suggest():
                self._suggest(message)
            case messages.RunPolicy():
                if self.client.is_person:
                    self._refuse(self._hub.policies.run(message.policy))
                else:
                    self._refuse("Only a person can start a policy on this robot, or end it.")
            case messages.Record() | messages.Mark() | messages.Undo():
                self._refuse(self._recording(message))
            case messages.Browse() | messages.Fetch() | messages.Judge():
                self._refuse(self._recording(message))
            case _:
                raise LinkError("The hello was sent already.")
        if self.client.is_full:
            raise LinkError(_NOT_READING)

    def count(self) -> None:
        """Count a message."""
        if not self._rate.spend():
            raise RobotRefused(f"Too many messages: {MESSAGES_PER_S:.0f} per second are allowed.")

    def close(self) -> None:
        """End the session."""
        self._hub.leave(self.client)

    def observe(self) -> messages.Observation:
        """Build the observation to send now, which uses up the credit."""
        hub = self._hub
        self._observation_seq += 1
        frame_sent = self._frame_seq if self._wants_frames else None
        observation = hub.observation(self.client, self._observation_seq, frame_sent)
        self._sent.add(observation.seq, observation.sent_ns)
        if hub.recorder.builder is not None:
            hub.recorder.builder.observed(self.client, observation, hub.frame)
        if observation.frame is not None:
            self._frame_seq = observation.frame_seq
        if self.pace == "lockstep":
            self._rate.give_back()  # The robot set the pace, however fast.
        self.credit = False
        return observation

    def _refuse(self, reason: str, seq: int | None = None) -> None:
        """Report a refusal, unless `reason` is empty."""
        if reason:
            self.client.post(messages.Refused(reason=reason, seq=seq))

    def _give_credit(self) -> None:
        self.credit = True
        self.client.updated.set()

    def _command(self, command: messages.Command) -> None:
        now_ns = self._hub.now_ns()
        refusal = ""
        if self._hub.lease.holder is not self.client:
            refusal = "You do not have control; take it first."
        elif command.seq <= self._command_seq:
            refusal = f"Command {command.seq} is not newer than {self._command_seq}."
        elif refusal := self._values_refusal(command.values):
            # The previous command is no longer what the client wants. A late or repeated command
            # proves nothing of that kind, and must not stop a newer one.
            self._hub.halt()
        else:
            refusal = self._sent.refusal(command.answers, now_ns)
        self._command_seq = max(self._command_seq, command.seq)
        self._refuse(refusal, command.seq)
        if not refusal:
            self._hub.command(self.client, command, now_ns)
        self._give_credit()

    def _suggest(self, suggestion: messages.Suggest) -> None:
        if self._hub.lease.holder is self.client:
            refusal = "You have control: send a command instead of a suggestion."
        elif suggestion.seq <= self._suggestion_seq:
            refusal = f"Suggestion {suggestion.seq} is not newer than {self._suggestion_seq}."
        else:
            refusal = self._values_refusal(suggestion.values) or self._sent.refusal(
                suggestion.answers, self._hub.now_ns()
            )
        self._suggestion_seq = max(self._suggestion_seq, suggestion.seq)
        self._refuse(refusal, suggestion.seq)
        if not refusal:
            self._hub.suggest(self.client, suggestion.values)
        self._give_credit()

    def _values_refusal(self, values: tuple[float, ...]) -> str:
        """Return the fault in the values of a command, or ""."""
        if len(values) != self._hub.action_size:
            return f"A command of this robot has {self._hub.action_size} values, got {len(values)}."
        if not all(math.isfinite(v) and abs(v) <= _LARGEST_VALUE for v in values):
            return f"The values of a command must be finite and at most {_LARGEST_VALUE:g}."
        return ""

    def _arm(self, arm: messages.Arm) -> None:
        hub, person = self._hub, self.client.is_person
        refusal = ""
        if hub.lease.holder is None:
            refusal = "No client has control; take control first."
        elif not person and hub.plan.card.arming != "anyone":
            refusal = "Only a person can arm this robot."
        elif not person and hub.state.emergency:
            refusal = "Only a person can end an emergency stop."
        elif not person and hub.lease.holder is not self.client:
            refusal = "Only the client in control, or a person, can arm this robot."
        elif late := self._sent.refusal(arm.answers, hub.now_ns()):
            refusal = f"Not armed. {late}"
        self._refuse(refusal)
        if not refusal:
            # The guard knows every emergency stop; this process only those reported to it.
            hub.give_order(Order(kind="arm", emergency=arm.emergency, person=person))

    def _disarm(self) -> None:
        if not self.client.is_person and self._hub.lease.holder is not self.client:
            self._refuse(
                "Only the client in control, or a person, can disarm this robot; any client can "
                "stop it with an emergency stop."
            )
            return
        self._hub.give_order(Order(kind="disarm", reason=f"{self.client.name} disarmed"))

    def _recording(
        self, message: messages.Record | messages.Mark | messages.Undo | Question
    ) -> str:
        """Handle a request about recordings. Return the reason for a refusal, or ""."""
        is_question = isinstance(message, messages.Browse | messages.Fetch)
        if not is_question and not self.client.is_person:
            return "Only a person can record on this robot, and judge recordings."
        recorder = self._hub.recorder
        match message:
            case messages.Record(on=False):
                return recorder.end()
            case messages.Record():
                driver = self._hub.lease.holder_name
                return recorder.begin(self.client, printable(message.name), driver)
            case messages.Mark():
                return recorder.edit(messages.Mark(text=printable(message.text)), self.client)
            case messages.Undo():
                return recorder.edit(message, self.client)
            case _:
                # An answer may be large, so the next question waits until it has left.
                if self._awaits_library or self.client.awaits(messages.Recordings, messages.Piece):
                    return "Ask one question about recordings at a time."
                self._awaits_library = True
                self._hub.library.ask(message, self._library_answered)
                return ""

    def _library_answered(self, answer: Answer) -> None:
        self._awaits_library = False
        self.client.post(answer)


class ClientConnection:
    """WebSocket of one session: receives, answers, and sends observations when they are due."""

    def __init__(self, session: Session, hub: SessionHub, time: Timekeeper) -> None:
        self._session = session
        self._client = session.client
        self._hub = hub
        self._time = time
        # Uncompressed, and without a send queue.
        self._socket = web.WebSocketResponse(
            timeout=_CLOSE_S,
            autoping=False,  # Pings count as messages here, so that they cannot flood the robot.
            heartbeat=_HEARTBEAT_S,
            compress=False,
            # Above the limit, so that an oversized message gets an error message, and still
            # bounded.
            max_msg_size=4 * messages.MAX_CLIENT_MESSAGE,
            writer_limit=0,
        )
        self._period_s = 1.0 / hub.plan.card.control_hz
        camera = hub.plan.camera
        ratio = 0.0 if camera is None else camera.fps / hub.plan.card.control_hz
        self._by_frames = 1.0 / _FRAME_PACE <= ratio <= _FRAME_PACE
        self._due_s = 0.0

    async def run(
        self, request: web.Request, on_known: Callable[[], object]
    ) -> web.WebSocketResponse:
        """Serve the client until it leaves; `on_known` is called once it has authenticated."""
        await self._socket.prepare(request)
        client = self._client
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
            if isinstance(error, WrongKey):
                await asyncio.sleep(_WRONG_KEY_S)
        finally:
            # If this client was in control, the robot stops before anything else happens.
            self._session.close()
        if reason is not None:
            _log.info("%s: %s", client.name or request.remote, reason)
            with contextlib.suppress(LinkError):  # The client may read no more.
                await self._send(messages.Refused(reason=str(reason), fatal=True))
        await self._time.settle()
        await self._close()
        return self._socket

    async def _greet(self) -> None:
        """Authenticate the client."""
        await self._send(self._session.challenge())
        late = LinkError(f"No hello was received within {HELLO_TIMEOUT_S:.0f} s.")
        with translate_errors(TimeoutError, to=lambda _: late):
            async with asyncio.timeout(HELLO_TIMEOUT_S):
                data = await self._read()
        if data is None:
            raise LinkError("The client left without a hello.")
        await self._send(self._session.introduce(data))

    async def _exchange(self) -> None:
        """Exchange messages until the client disconnects."""
        tasks = [
            asyncio.create_task(work) for work in (self._listen(), self._answer(), self._observe())
        ]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in tasks:
                task.cancel()
            results = await asyncio.gather(*tasks, return_exceptions=True)
        for result in results:
            if isinstance(result, BaseException) and not isinstance(result, asyncio.CancelledError):
                raise result

    async def _close(self) -> None:
        """Close the WebSocket."""
        try:
            async with asyncio.timeout(2 * _CLOSE_S):
                await self._socket.close(code=aiohttp.WSCloseCode.OK, drain=False)
        except (TimeoutError, ConnectionError, RuntimeError):
            _log.info("The connection of %s was cut.", self._client.name or "a client")

    async def _send(self, message: messages.RobotMessage) -> None:
        await self._in_time(self._socket.send_bytes(messages.encode(message)))

    async def _in_time(self, sending: Awaitable[None]) -> None:
        """Wait for a message to be sent."""
        with (
            translate_errors(TimeoutError, to=lambda _: LinkError(_NOT_READING)),
            translate_errors(ConnectionError, RuntimeError, to=_ended),
        ):
            async with asyncio.timeout(_SEND_S):
                await sending

    async def _listen(self) -> None:
        while (data := await self._read()) is not None:
            self._session.receive(data)
            await self._time.settle()
            if self._client.awaits():
                await asyncio.sleep(0)  # A client that asks faster than it is answered waits.

    async def _answer(self) -> None:
        client = self._client
        while True:
            await client.posted.wait()
            client.posted.clear()
            while (message := client.take()) is not None:
                await self._send(message)
            if client.is_full:
                raise LinkError(_NOT_READING)
            if client.expelled:
                raise LinkError(client.expelled)

    async def _observe(self) -> None:
        while True:
            await self._send(await self._next_observation())

    async def _next_observation(self) -> messages.Observation:
        """Return the next observation, once it is due and the client has credit for it."""
        session, lease = self._session, self._hub.lease
        while not session.credit:
            self._client.updated.clear()
            await self._client.updated.wait()
        if session.pace == "lockstep" and not self._time.in_steps:
            await self._time.step(self._period_s)
        # The lease holder advances time, or any client without a holder.
        elif self._time.in_steps and lease.holder in (None, self._client):
            await self._time.step(self._period_s)
            if session.pace == "realtime":
                await self._wait_until_due()
        else:
            await self._wait_until_due()
        return session.observe()

    async def _wait_until_due(self) -> None:
        """Wait until one period after the last observation was due, or for its frame."""
        loop = asyncio.get_running_loop()
        while not (self._by_frames and self._session.has_new_frame) and loop.time() < self._due_s:
            self._client.updated.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout_at(self._due_s):
                    await self._client.updated.wait()
        now_s = loop.time()
        if self._by_frames and self._hub.frame is not None:
            self._due_s = now_s + _FRAME_PACE * self._period_s
        else:
            # Counted from the time it was due, so that delays do not add up; but a client that
            # was away gets no burst.
            was_s = self._due_s if now_s - self._due_s < self._period_s else now_s
            self._due_s = was_s + self._period_s

    async def _read(self) -> bytes | None:
        """Return the next message, or None when the client has disconnected."""
        while True:
            message = await self._socket.receive()
            if message.type is WSMsgType.BINARY:
                return message.data
            if message.type is WSMsgType.PING:
                self._session.count()
                await self._in_time(self._socket.pong(message.data))
            elif message.type is WSMsgType.PONG:
                self._session.count()
            elif message.type is WSMsgType.TEXT:
                raise LinkError("The link takes binary messages, got text.")
            elif message.type is WSMsgType.ERROR:
                raise LinkError(f"The message cannot be read: {message.data}.")
            else:
                return None


def _ended(error: ConnectionError | RuntimeError) -> LinkError:
    return LinkError(f"The connection ended: {error}")


def _tune(transport: asyncio.Transport | None) -> None:
    """Send at once, buffer little, and notice when the other end is gone."""
    if transport is None:
        raise LinkError("The connection ended.")
    # Not 0: asyncio's TLS would then call an empty buffer full every second time, and a message
    # that was sent would wait for the next one before it counts as sent.
    transport.set_write_buffer_limits(high=1, low=0)
    accepted = transport.get_extra_info("socket")
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    accepted.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, _UNANSWERED_MS)
