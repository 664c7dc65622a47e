"""One connection: who it is, and what is done with what it says. Bytes in, messages out."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Final

from shapechanger.errors import LinkError, RobotRefused
from shapechanger.link.authentication import is_proof, new_nonce
from shapechanger.link.messages import (
    VERSION,
    Acknowledge,
    Arm,
    Browse,
    Challenge,
    Command,
    Disarm,
    EmergencyStop,
    Fetch,
    Hello,
    Judge,
    Mark,
    Observation,
    Pace,
    Piece,
    Ping,
    Pong,
    Record,
    Recordings,
    Refused,
    Release,
    RobotMessage,
    Suggest,
    Take,
    Undo,
    Welcome,
    decode_client_message,
)
from shapechanger.robot.daemon.control import ClientIdentity, ControlLease
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.library import Answer, RecordingLibrary
from shapechanger.robot.daemon.limits import (
    MESSAGES_PER_S,
    MessageRate,
    Outbox,
    SentObservations,
    printable,
)
from shapechanger.robot.daemon.observation import build_observation
from shapechanger.robot.daemon.recorder import Recorder
from shapechanger.robot.guard.messages import Order

__all__ = ["Authenticator", "RecordingRequests", "Session", "WrongKey"]


class RecordingRequests:
    """Passes the wishes of one client on, if it may have them.

    Args:
        recorder: Records what is driven.
        library: Knows what was recorded.
        lease: Who commands.
        outbox: What the client is to be told.
        tell: Puts a message there.
    """

    def __init__(
        self,
        recorder: Recorder,
        library: RecordingLibrary,
        lease: ControlLease,
        outbox: Outbox,
        tell: Callable[[RobotMessage], None],
    ) -> None:
        self._recorder = recorder
        self._library = library
        self._lease = lease
        self._outbox = outbox
        self._tell = tell
        self._asking = False

    def hear(
        self, message: Record | Mark | Undo | Browse | Fetch | Judge, who: ClientIdentity
    ) -> None:
        """Do what the client says, or tell it why not."""
        if not isinstance(message, Browse | Fetch) and who.role != "person":
            self._tell(Refused(reason="Only a person records on this robot, and judges that."))
            return
        match message:
            case Record():
                refusal = self._record(message, who)
            case Mark():
                refusal = self._recorder.mark(printable(message.text), self._tell)
            case Undo():
                refusal = self._recorder.undo(message.seconds, self._tell)
            case Browse() | Fetch() | Judge():
                refusal = self._ask(message)
        if refusal:
            self._tell(Refused(reason=refusal))

    def _record(self, message: Record, who: ClientIdentity) -> str:
        if not message.on:
            return self._recorder.end()
        held = self._lease.holder
        driver = "" if held is None else held.name
        return self._recorder.begin(who, printable(message.name), driver, self._tell)

    def _ask(self, question: Browse | Fetch | Judge) -> str:
        """Ask the library; an answer may be large, so the next question waits until it has left."""
        if self._asking or self._outbox.holds(Recordings, Piece):
            return "Ask one question about recordings at a time."
        self._asking = True
        self._library.ask(question, self._answered)
        return ""

    def _answered(self, answer: Answer) -> None:
        self._asking = False
        self._tell(answer)


_LARGEST_VALUE: Final = 1e6  # The guard clips to 1 in any case; this keeps overflow out of sums.


class WrongKey(RobotRefused):
    """The client does not hold the key."""


class Authenticator:
    """What a client must show to be let in.

    Args:
        key: The key; empty for none.
        certificate: Fingerprint of the certificate; empty without TLS.
    """

    def __init__(self, key: bytes = b"", certificate: bytes = b"") -> None:
        self._key = key
        self._certificate = certificate

    @property
    def certificate(self) -> bytes:
        """Fingerprint of the certificate; empty without TLS."""
        return self._certificate

    @property
    def is_open(self) -> bool:
        """Whether everybody is let in."""
        return not self._key

    def lets_in(self, hello: Hello, nonce: bytes) -> bool:
        """Whether the client holds the key."""
        if self.is_open:
            return True
        return is_proof(hello.proof, self._key, nonce, self._certificate, hello.role)


class Session:
    """One connection, without its socket.

    Args:
        number: Its number, never used twice.
        cockpit: What all connections share.
        door: What the client must show.
        rate: How much it may say.

    Attributes:
        outbox: What it is told besides observations.
        told: Set when there is something in the outbox.
        news: Set when there may be an observation to send.
        credit: Whether the client waits for an observation.
    """

    def __init__(
        self, number: int, cockpit: SessionHub, door: Authenticator, rate: MessageRate | None = None
    ) -> None:
        self.outbox = Outbox()
        self.told = asyncio.Event()
        self.news = asyncio.Event()
        self.credit = False
        self._number = number
        self._cockpit = cockpit
        self._door = door
        self._rate = MessageRate() if rate is None else rate
        self._nonce = new_nonce()
        self._hello: Hello | None = None
        self._who = ClientIdentity(number, "", "program")
        self._sent = SentObservations(cockpit.plan.max_observation_age_ms)
        self._command_seq = -1
        self._suggestion_seq = -1
        self._desk = RecordingRequests(
            cockpit.recorder, cockpit.library, cockpit.lease, self.outbox, self.tell
        )
        self._observation_seq = 0
        self._frame_seq = 0
        self._overflow = ""

    @property
    def who(self) -> ClientIdentity:
        """Who it is; without a name before it said hello."""
        return self._who

    @property
    def pace(self) -> Pace:
        """Who keeps the time."""
        return "realtime" if self._hello is None else self._hello.pace

    @property
    def has_new_frame(self) -> bool:
        """Whether there is a picture that the client wants and was not sent."""
        newest = self._cockpit.newest
        wants = self._hello is not None and self._hello.frames
        return wants and newest is not None and newest.seq != self._frame_seq

    def challenge(self) -> Challenge:
        """The first message to the client."""
        return Challenge(version=VERSION, nonce=self._nonce, robot=self._cockpit.plan.robot)

    def introduce(self, data: bytes) -> Welcome:
        """Let the client in, by its first message.

        Raises:
            WrongKey: If it does not hold the key.
            RobotRefused: If it speaks another version, or there is no place.
            LinkError: If this is no greeting.
        """
        hello = decode_client_message(data)
        if not isinstance(hello, Hello) or self._hello is not None:
            raise LinkError("The first message must be a hello.")
        if hello.version != VERSION:
            raise RobotRefused(
                f"The robot speaks version {VERSION} of the link, and you speak {hello.version}: "
                "install the same version of shapechanger on both."
            )
        if not self._door.lets_in(hello, self._nonce):
            raise WrongKey(
                "Wrong key. `shapechanger robot key NAME` shows the right one on the robot."
            )
        name = printable(hello.name) or f"{hello.role} {self._number}"
        self._who = ClientIdentity(self._number, name, hello.role)
        self._cockpit.join(self)
        self._hello = hello
        if (recorded := self._cockpit.recorder.state()).episode:
            self.tell(recorded)
        return self._welcome()

    def receive(self, data: bytes) -> None:
        """Do what the client says.

        Raises:
            LinkError: If the connection must end, and why.
        """
        if self._hello is None:
            raise LinkError("The first message must be a hello.")
        self.count()
        message = decode_client_message(data)
        match message:
            case Command():
                self._command(message)
            case Acknowledge():
                self._give_credit()
            case Take():
                self._cockpit.take(self._who)
            case Release():
                self._cockpit.release(self._who, f"{self._who.name} gave the command back")
            case Arm():
                self._arm(message)
            case Disarm():
                self._disarm()
            case EmergencyStop():
                self._emergency(message)
            case Ping():
                self.tell(Pong(token=message.token, now_ns=self._cockpit.now_ns()))
            case Suggest():
                self._suggest(message)
            case Record() | Mark() | Undo() | Browse() | Fetch() | Judge():
                self._desk.hear(message, self._who)
            case Hello():
                raise LinkError("You said hello already.")
        if self._overflow:
            raise LinkError(self._overflow)

    def count(self) -> None:
        """Count a message.

        Raises:
            RobotRefused: If there are too many.
        """
        if not self._rate.spend():
            raise RobotRefused(
                f"You say too much: {MESSAGES_PER_S:.0f} messages a second are allowed."
            )

    def close(self) -> None:
        """The connection has ended."""
        self._cockpit.leave(self._number)

    def tell(self, message: RobotMessage) -> None:
        """Put a message in the outbox; one that does not read is noticed by its connection."""
        try:
            self.outbox.put(message)
        except LinkError as error:
            self._overflow = str(error)
        self.told.set()

    @property
    def overflow(self) -> str:
        """Why the connection must end, because the client does not read; empty if it does."""
        return self._overflow

    def notice(self) -> None:
        """There is a new state or picture."""
        self.news.set()

    def observe(self) -> Observation:
        """The observation that leaves now; it costs the credit."""
        cockpit, now_ns = self._cockpit, self._cockpit.now_ns()
        self._observation_seq += 1
        frames = self._hello is not None and self._hello.frames
        observation = build_observation(
            seq=self._observation_seq,
            now_ns=now_ns,
            reader=cockpit.reader,
            state=cockpit.state,
            newest=cockpit.newest,
            frame_sent=self._frame_seq if frames else None,
            lease=cockpit.lease.number,
            command_ns=cockpit.command_ns(),
            holder=cockpit.lease.holder,
            mine=cockpit.lease.holds(self._number),
            commanded=cockpit.commanded(),
            suggested=cockpit.suggested(),
        )
        self._sent.add(observation.seq, now_ns)
        cockpit.recorder.observed(self._number, observation, cockpit.newest)
        if observation.frame is not None:
            self._frame_seq = observation.frame_seq
        if self.pace == "lockstep":
            self._rate.give_back()  # The robot kept the pace, however fast that was.
        self.credit = False
        return observation

    def _command(self, command: Command) -> None:
        now_ns = self._cockpit.now_ns()
        refusal = self._refusal_to_listen(command)
        if not refusal:
            refusal = self._nonsense(command.values)
            if refusal:
                # The one before is no longer what the client wants. What is refused for being late
                # says nothing about that, and what is old must not stop what is newer.
                self._cockpit.halt()
            else:
                refusal = self._sent.refusal(command.answers, now_ns)
        self._command_seq = max(self._command_seq, command.seq)
        if refusal:
            self.tell(Refused(reason=refusal, seq=command.seq))
        else:
            self._cockpit.command(command, now_ns)
        self._give_credit()

    def _suggest(self, suggestion: Suggest) -> None:
        refusal = ""
        if self._cockpit.lease.holds(self._number):
            refusal = "You command: say what to do by a command."
        elif suggestion.seq <= self._suggestion_seq:
            refusal = f"Suggestion {suggestion.seq} is not newer than {self._suggestion_seq}."
        refusal = refusal or self._nonsense(suggestion.values)
        if not refusal:
            refusal = self._sent.refusal(suggestion.answers, self._cockpit.now_ns())
        self._suggestion_seq = max(self._suggestion_seq, suggestion.seq)
        if refusal:
            self.tell(Refused(reason=refusal, seq=suggestion.seq))
        else:
            self._cockpit.suggest(self._who, suggestion.values)
        self._give_credit()

    def _refusal_to_listen(self, command: Command) -> str:
        """Why a command does not count, whatever it says; empty when it does."""
        if not self._cockpit.lease.holds(self._number):
            return "You do not command; take the command first."
        if command.seq <= self._command_seq:
            return f"Command {command.seq} is not newer than {self._command_seq}."
        return ""

    def _nonsense(self, values: tuple[float, ...]) -> str:
        """What is wrong with the values of a command, in words; empty for nothing."""
        if len(values) != self._cockpit.action_size:
            return (
                f"A command of this robot has {self._cockpit.action_size} values, "
                f"this one has {len(values)}."
            )
        if not all(math.isfinite(v) and abs(v) <= _LARGEST_VALUE for v in values):
            return "A value is no finite number."
        return ""

    def _give_credit(self) -> None:
        self.credit = True
        self.news.set()

    def _arm(self, arm: Arm) -> None:
        refusal = self._refusal_to_arm()
        if not refusal and (late := self._sent.refusal(arm.answers, self._cockpit.now_ns())):
            refusal = f"Not armed. {late}"
        if refusal:
            self.tell(Refused(reason=refusal))
            return
        # The guard knows of each emergency stop, and this process only of those it was told.
        person = self._who.role == "person"
        self._cockpit.give_order(Order(kind="arm", emergency=arm.emergency, person=person))

    def _refusal_to_arm(self) -> str:
        """Why this client must not arm, in words; empty when it may."""
        state, is_person = self._cockpit.state, self._who.role == "person"
        if self._cockpit.lease.holder is None:
            return "Nobody commands; take the command first."
        if is_person:
            return ""
        if self._cockpit.plan.arming != "anyone":
            return "Only a person arms this robot."
        if state is not None and state.emergency:
            return "Only a person ends an emergency stop."
        if not self._cockpit.lease.holds(self._number):
            return "Only who commands, or a person, arms this robot."
        return ""

    def _disarm(self) -> None:
        if self._who.role != "person" and not self._cockpit.lease.holds(self._number):
            self.tell(
                Refused(
                    reason="Only who commands, or a person, disarms this robot; "
                    "anyone may stop it with an emergency stop."
                )
            )
            return
        self._cockpit.give_order(Order(kind="disarm", reason=f"{self._who.name} disarmed"))

    def _emergency(self, stop: EmergencyStop) -> None:
        reason = f"{self._who.name}: {printable(stop.reason) or 'stop'}"
        self._cockpit.give_order(Order(kind="emergency", reason=reason))

    def _welcome(self) -> Welcome:
        plan = self._cockpit.plan
        return Welcome(
            robot=plan.robot,
            body=plan.body,
            action_layout=plan.action_layout,
            state_layout=plan.state_layout,
            image_size=None if plan.camera is None else plan.camera.size,
            control_hz=plan.control_hz,
            deadline_ms=plan.deadline_ms,
            max_observation_age_ms=plan.max_observation_age_ms,
            reward=plan.reward,
            reset=plan.reset,
            arming=plan.arming,
            clock=plan.clock,
            session=self._number,
            can_record=self._cockpit.recorder.can_record,
        )
