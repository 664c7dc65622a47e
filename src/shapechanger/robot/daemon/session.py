"""Session of one client, without its socket: bytes in, messages out."""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from time import monotonic
from typing import Final

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.robot.daemon.control import ClientIdentity, build_observation
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.library import Answer, Question
from shapechanger.robot.guard.messages import Order
from shapechanger.robot.link import messages
from shapechanger.robot.link.authentication import is_proof, new_nonce

MESSAGES_PER_S: Final = 500.0
"""Messages per second that a connection may send; a driver sends 50."""

NOT_READING: Final = "The client does not read its messages."
"""Reason to end the connection of a client that leaves its messages unread."""

_MAX_EVENTS: Final = 32
_MAX_MESSAGES: Final = 256
_NS_PER_MS: Final = 1_000_000
_WINDOW: Final = 64  # More than a second at 50 Hz; older observations are stale in any case.

_LARGEST_VALUE: Final = 1e6  # The guard clips to 1 in any case; this keeps sums from overflowing.


class WrongKey(RobotRefused):
    """The client does not hold the key."""


@dataclass(frozen=True, slots=True)
class Authenticator:
    """Checks that a client holds the robot's key.

    Attributes:
        key: The key; empty to accept every client.
        certificate: Fingerprint of the certificate; empty without TLS.
    """

    key: bytes = field(default=b"", repr=False)  # It does not belong in a log.
    certificate: bytes = b""

    @property
    def is_open(self) -> bool:
        """True if the robot has no key and accepts every client."""
        return not self.key

    def accepts(self, hello: messages.Hello, nonce: bytes) -> bool:
        """Return True if the proof in `hello` answers `nonce` with the right key."""
        if self.is_open:
            return True
        return is_proof(hello.proof, self.key, nonce, self.certificate, hello.role)


class MessageRate:
    """Token bucket that holds one second's worth of messages."""

    def __init__(
        self, per_s: float = MESSAGES_PER_S, clock: Callable[[], float] = monotonic
    ) -> None:
        self._per_s = per_s
        self._clock = clock
        self._tokens = per_s
        self._at = clock()

    def spend(self) -> bool:
        """Count one message. Return False if it exceeds the rate."""
        now = self._clock()
        self._tokens = min(self._per_s, self._tokens + (now - self._at) * self._per_s)
        self._at = now
        if self._tokens < 1.0:
            return False
        self._tokens -= 1.0
        return True

    def give_back(self) -> None:
        """Uncount one message, because the robot set the pace."""
        self._tokens = min(self._per_s, self._tokens + 1.0)


class Outbox:
    """Queue of messages for one client, other than observations.

    It keeps the newest lease, the newest recorder state and the newest 32 events. Other messages
    are accepted while fewer than 256 are queued.

    Attributes:
        is_full: True once a message did not fit, because the client does not read.
    """

    def __init__(self) -> None:
        self.is_full = False
        self._messages: deque[messages.RobotMessage] = deque()

    def __len__(self) -> int:
        """Return the number of queued messages."""
        return len(self._messages)

    def put(self, message: messages.RobotMessage) -> None:
        """Add a message; one that does not fit is lost, and sets `is_full`."""
        if isinstance(message, messages.Lease | messages.RecorderState):
            self._trim(type(message), keep=0)
        elif isinstance(message, messages.Event):
            self._trim(messages.Event, keep=_MAX_EVENTS - 1)
        elif len(self._messages) >= _MAX_MESSAGES:
            self.is_full = True
            return
        self._messages.append(message)

    def take(self) -> messages.RobotMessage | None:
        """Remove and return the oldest message, or None if the queue is empty."""
        return self._messages.popleft() if self._messages else None

    def holds(self, *kinds: type[messages.RobotMessage]) -> bool:
        """Return True if a message of one of these types is queued."""
        return any(isinstance(message, kinds) for message in self._messages)

    def _trim(self, kind: type[messages.RobotMessage], keep: int) -> None:
        """Remove the oldest messages of a type until `keep` are left."""
        queued = [message for message in self._messages if isinstance(message, kind)]
        for message in queued[: max(0, len(queued) - keep)]:
            self._messages.remove(message)


class SentObservations:
    """The last observations sent to one client, and when."""

    def __init__(self, max_age_ms: int, window: int = _WINDOW) -> None:
        self._max_age_ms = max_age_ms
        self._sent: deque[tuple[int, int]] = deque(maxlen=window)

    def add(self, seq: int, now_ns: int) -> None:
        """Remember that an observation is sent now."""
        self._sent.append((seq, now_ns))

    def refusal(self, answers: int, now_ns: int) -> str:
        """Return the reason why a message must not act, or "" if it may."""
        sent_ns = dict(self._sent).get(answers)
        if sent_ns is None:
            return f"Observation {answers} was not sent to this client recently."
        age_ms = (now_ns - sent_ns) / _NS_PER_MS
        if age_ms > self._max_age_ms:
            return (
                f"Observation {answers} was sent {age_ms:.0f} ms ago; "
                f"at most {self._max_age_ms} ms are allowed."
            )
        return ""


def printable(text: str) -> str:
    """Return `text` as one line, without control characters."""
    return "".join(c if c.isprintable() else " " for c in text).strip()


class Session:
    """Session of one client, without its socket.

    Attributes:
        outbox: Messages for the client, other than observations.
        posted: Set when the outbox has a message.
        updated: Set when an observation may be due.
        credit: True while the client waits for an observation.
        client: Identity of the client; its name is empty before its hello.
        pace: Whether the robot's clock or the client sets the pace.
        expelled: Reason why the connection must end; "" if it may go on.
    """

    def __init__(
        self,
        number: int,
        hub: SessionHub,
        authenticator: Authenticator,
        rate: MessageRate | None = None,
    ) -> None:
        self.outbox = Outbox()
        self.posted = asyncio.Event()
        self.updated = asyncio.Event()
        self.credit = False
        self.client = ClientIdentity(number, "", "program")
        self.pace: messages.Pace = "realtime"
        self.expelled = ""
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
        newest = self._hub.newest
        return self._wants_frames and newest is not None and newest.seq != self._frame_seq

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
        name = printable(hello.name) or f"{hello.role} {self.client.session}"
        self.client = ClientIdentity(self.client.session, name, hello.role)
        self._hub.join(self)
        self._is_known, self.pace, self._wants_frames = True, hello.pace, hello.frames
        if (recorded := self._hub.recorder.state()).episode:
            self.post(recorded)
        if self._hub.plan.policies:
            self.post(self._hub.policies.state())
        can_record = bool(self._hub.plan.recordings)
        return messages.Welcome.of(self._hub.plan.card, self.client.session, can_record=can_record)

    def receive(self, data: bytes) -> None:
        """Handle a message of the client."""
        if not self._is_known:
            raise LinkError("The first message must be a hello.")
        if self.expelled:
            raise LinkError(self.expelled)
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
                self.post(messages.Pong(token=message.token, now_ns=self._hub.now_ns()))
            case messages.Suggest():
                self._suggest(message)
            case messages.RunPolicy():
                if self.client.role == "person":
                    self._refuse(self._hub.policies.run(message.policy))
                else:
                    self._refuse("Only a person can start a policy on this robot, or end it.")
            case messages.Record() | messages.Mark() | messages.Undo():
                self._refuse(self._recording(message))
            case messages.Browse() | messages.Fetch() | messages.Judge():
                self._refuse(self._recording(message))
            case _:
                raise LinkError("The hello was sent already.")
        if self.outbox.is_full:
            raise LinkError(NOT_READING)

    def count(self) -> None:
        """Count a message."""
        if not self._rate.spend():
            raise RobotRefused(f"Too many messages: {MESSAGES_PER_S:.0f} per second are allowed.")

    def expel(self, reason: str) -> None:
        """End the connection, with a reason for the client."""
        self.expelled = reason
        self.posted.set()

    def close(self) -> None:
        """End the session."""
        self._hub.leave(self.client.session)

    def post(self, message: messages.RobotMessage) -> None:
        """Queue a message; if the queue is full, the connection ends."""
        self.outbox.put(message)
        self.posted.set()

    def observe(self) -> messages.Observation:
        """Build the observation to send now, which uses up the credit."""
        hub, now_ns = self._hub, self._hub.now_ns()
        self._observation_seq += 1
        observation = build_observation(
            seq=self._observation_seq,
            now_ns=now_ns,
            reader=hub.reader,
            state=hub.state,
            newest=hub.newest,
            frame_sent=self._frame_seq if self._wants_frames else None,
            lease=hub.lease.number,
            command_ns=hub.command_ns(),
            holder=hub.lease.holder,
            mine=hub.lease.holds(self.client.session),
            commanded=hub.commanded(),
            suggested=hub.suggested(),
        )
        self._sent.add(observation.seq, now_ns)
        if hub.recorder.builder is not None:
            hub.recorder.builder.observed(self.client.session, observation, hub.newest)
        if observation.frame is not None:
            self._frame_seq = observation.frame_seq
        if self.pace == "lockstep":
            self._rate.give_back()  # The robot set the pace, however fast.
        self.credit = False
        return observation

    def _refuse(self, reason: str, seq: int | None = None) -> None:
        """Report a refusal, unless `reason` is empty."""
        if reason:
            self.post(messages.Refused(reason=reason, seq=seq))

    def _give_credit(self) -> None:
        self.credit = True
        self.updated.set()

    def _command(self, command: messages.Command) -> None:
        now_ns = self._hub.now_ns()
        refusal = ""
        if not self._hub.lease.holds(self.client.session):
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
        if self._hub.lease.holds(self.client.session):
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
        hub, person = self._hub, self.client.role == "person"
        refusal = ""
        if hub.lease.holder is None:
            refusal = "No client has control; take control first."
        elif not person and hub.plan.card.arming != "anyone":
            refusal = "Only a person can arm this robot."
        elif not person and hub.state is not None and hub.state.emergency:
            refusal = "Only a person can end an emergency stop."
        elif not person and not hub.lease.holds(self.client.session):
            refusal = "Only the client in control, or a person, can arm this robot."
        elif late := self._sent.refusal(arm.answers, hub.now_ns()):
            refusal = f"Not armed. {late}"
        self._refuse(refusal)
        if not refusal:
            # The guard knows every emergency stop; this process only those reported to it.
            hub.give_order(Order(kind="arm", emergency=arm.emergency, person=person))

    def _disarm(self) -> None:
        if self.client.role != "person" and not self._hub.lease.holds(self.client.session):
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
        if (
            not isinstance(message, messages.Browse | messages.Fetch)
            and self.client.role != "person"
        ):
            return "Only a person can record on this robot, and judge recordings."
        recorder = self._hub.recorder
        match message:
            case messages.Record(on=False):
                return recorder.end()
            case messages.Record():
                driver = self._hub.lease.holder_name
                return recorder.begin(self.client, printable(message.name), driver, self.post)
            case messages.Mark():
                return recorder.edit(messages.Mark(text=printable(message.text)), self.post)
            case messages.Undo():
                return recorder.edit(message, self.post)
            case _:
                # An answer may be large, so the next question waits until it has left.
                if self._awaits_library or self.outbox.holds(messages.Recordings, messages.Piece):
                    return "Ask one question about recordings at a time."
                self._awaits_library = True
                self._hub.library.ask(message, self._library_answered)
                return ""

    def _library_answered(self, answer: Answer) -> None:
        self._awaits_library = False
        self.post(answer)
