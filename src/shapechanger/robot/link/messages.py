"""Messages between a client and a robot, each one binary WebSocket message; see `docs/wire.md`.

A message is a msgpack map with its type under `kind`; JPEG bytes are embedded unchanged. Unknown
keys are ignored, so that newer minor versions stay readable; unknown types are refused. Times are
nanoseconds of the robot's monotonic clock. Clocks of two machines are never subtracted: the age of
a command is the time since the robot sent the observation that it answers.
"""

from __future__ import annotations

from functools import partial
from typing import Annotated, Final, Literal, TypeVar, Union

import msgspec
from msgspec import Meta

from shapechanger.errors import LinkError, translate_errors
from shapechanger.robot.link.card import RobotCard

VERSION: Final = 1
"""Version of the messages, which must be the same on both sides."""

MAX_CLIENT_MESSAGE: Final = 64 * 1024
"""Largest message that a robot reads, bytes; a larger one is an attack or a bug."""

MAX_ROBOT_MESSAGE: Final = 4 * 1024 * 1024
"""Largest message that a client reads, bytes."""

MAX_PIECE: Final = 256 * 1024
"""Approximate size of a `Piece`, bytes, so that it does not delay observations on a slow radio."""

MAX_EPISODES: Final = 200
"""Most episodes in one `Recordings`; `Browse.before` requests older ones."""

Role = Literal["person", "program"]
"""Kind of client. A person can take control from a program; a program only if no client has it."""

Pace = Literal["realtime", "lockstep"]
"""Pace: both sides follow their clocks ("realtime"), or the robot waits for a command and answers
with the observation one control period later ("lockstep")."""

_M = TypeVar("_M")

# Names are written by people, and end up in logs and on screens.
_Name = Annotated[str, Meta(max_length=64)]
_Words = Annotated[str, Meta(max_length=1024)]
_Sequence = Annotated[int, Meta(ge=0, le=2**53)]
_Values = Annotated[tuple[float, ...], Meta(max_length=64)]
# A folder directly in the folder of recordings: no separator, and no leading dot.
_Episode = Annotated[str, Meta(max_length=128, pattern=r"^[0-9A-Za-z][0-9A-Za-z._-]*\Z")]
_Before = Annotated[str, Meta(max_length=128, pattern=r"^([0-9A-Za-z][0-9A-Za-z._-]*)?\Z")]


class _Message(msgspec.Struct, frozen=True, tag_field="kind", tag=str.lower, kw_only=True):
    """A message of either side."""

    def __repr__(self) -> str:
        """Show only the length of fields of bytes, to keep frames and proofs out of logs."""
        fields = (
            f"{name}=<{len(value)} bytes>" if isinstance(value, bytes) else f"{name}={value!r}"
            for name, value in msgspec.structs.asdict(self).items()
        )
        return f"{type(self).__name__}({', '.join(fields)})"


class ClientMessage(_Message, frozen=True):
    """A message of a client."""


class Hello(ClientMessage, frozen=True):
    """First message of a client.

    Attributes:
        version: Version of the messages that the client uses.
        proof: Answer to the challenge, see `shapechanger.robot.link.authentication`.
        name: Display name.
        role: Kind of client.
        pace: Whether the clocks or the client set the pace.
        frames: Whether observations contain frames.
    """

    version: int
    proof: Annotated[bytes, Meta(max_length=64)]
    name: _Name = ""
    role: Role = "program"
    pace: Pace = "realtime"
    frames: bool = True


class Command(ClientMessage, frozen=True):
    """Values of the actions, in force until the next command or until they expire.

    Attributes:
        seq: Number of the command, larger than the one before.
        answers: `seq` of the observation that the command answers.
        values: One number for each action of the robot, in the order of its action layout.
        ttl_ms: Lifetime from the arrival, ms; the robot's deadline applies if it is shorter.
        scale: Factor of the values, 0 to 1, by which a client limits its commands.
    """

    seq: _Sequence
    answers: _Sequence
    values: _Values
    ttl_ms: Annotated[int, Meta(ge=1, le=60_000)] = 1_000
    scale: Annotated[float, Meta(ge=0.0, le=1.0)] = 1.0


class Acknowledge(ClientMessage, frozen=True):
    """Request for the next observation, without a command; `seq` is the newest one, 0 for none."""

    seq: _Sequence = 0


class Take(ClientMessage, frozen=True):
    """Request for control."""


class Release(ClientMessage, frozen=True):
    """Return of control; the robot stops and disarms."""


class Arm(ClientMessage, frozen=True):
    """Request to let the outputs move; from a person it also ends an emergency stop.

    Attributes:
        answers: `seq` of a recent observation, like a command's: a delayed request must not arm a
            robot that its operator no longer watches.
        emergency: Number of emergency stops that the sender has seen
            (`Observation.emergencies`). A later one stays in force.
    """

    answers: _Sequence
    emergency: _Sequence = 0


class Disarm(ClientMessage, frozen=True):
    """Request to stop the robot until it is armed; from the client in control or a person."""


class EmergencyStop(ClientMessage, frozen=True):
    """Stop of all outputs, from any client, until a person arms the robot again."""

    reason: _Words = ""


class Ping(ClientMessage, frozen=True):
    """Request for a `Pong` with the same token."""

    token: _Sequence = 0


class Suggest(ClientMessage, frozen=True):
    """Values that a client without control would command; the robot does not apply them.

    A suggestion is shown to all clients (`Observation.suggested`) and recorded. Like a command, it
    requests the next observation. It expires after `Welcome.deadline_ms`, and when its sender
    disconnects or takes control.

    Attributes:
        seq: Number of the suggestion, larger than the one before; see `Refused.seq`.
        answers: `seq` of the observation that the suggestion answers.
        values: One number for each action of the robot, in the order of its action layout.
    """

    seq: _Sequence
    answers: _Sequence
    values: _Values


class Record(ClientMessage, frozen=True):
    """Begin or end of an episode on the robot's disk; only from a person.

    Answered by `RecorderState` to all clients, or by `Refused`. Commands of the client in control
    are recorded while the robot is armed. The episode ends when the last person disconnects.

    Attributes:
        on: Whether to record.
        name: Title of the episode.
    """

    on: bool
    name: _Name = ""


class Mark(ClientMessage, frozen=True):
    """Mark with a text for the newest step of the episode being recorded; only from a person."""

    text: _Words = ""


class Undo(ClientMessage, frozen=True):
    """Request to drop the last `seconds` of the episode being recorded; only from a person.

    The steps stay on the disk, and are not used for training.
    """

    seconds: Annotated[float, Meta(gt=0.0, le=3_600.0)] = 5.0


class Browse(ClientMessage, frozen=True):
    """Request for `Recordings` with ids before `before`, or the newest ones for ""."""

    before: _Before = ""


class Fetch(ClientMessage, frozen=True):
    """Request for a `Piece`; until it is sent, `Browse`, `Fetch` and `Judge` are refused.

    Attributes:
        episode: Id of the episode.
        first: Number of the first line of `steps.jsonl`, from 0.
        count: Most lines to send.
    """

    episode: _Episode
    first: _Sequence = 0
    count: Annotated[int, Meta(ge=1, le=100_000)] = 1_000


class Judge(ClientMessage, frozen=True):
    """Decision of a person to drop or keep steps for training; answered by `Recordings`.

    Attributes:
        episode: Id of the episode, which must not be the one being recorded.
        first: Number of the first step.
        last: Number of the last step, inclusive.
        keep: Whether to use the steps for training.
    """

    episode: _Episode
    first: _Sequence
    last: _Sequence
    keep: bool = False


class RunPolicy(ClientMessage, frozen=True):
    """Start of a policy on board, instead of the running one; only from a person.

    Answered by `PolicyState` to all clients, or by `Refused`. The policy is a separate client, a
    program: it waits until no client has control, takes it, and drives once a person arms the
    robot.

    Attributes:
        policy: Name of the policy, one of `PolicyState.names`; "" to end the one that runs.
    """

    policy: _Name = ""


class RobotMessage(_Message, frozen=True):
    """A message of a robot."""


class Challenge(RobotMessage, frozen=True):
    """First message of a robot.

    Attributes:
        version: Version of the messages that the robot uses.
        nonce: Random bytes for the proof, new for each connection.
        robot: Name of the robot.
    """

    version: int
    nonce: bytes
    robot: str


class Welcome(RobotCard, RobotMessage, frozen=True, kw_only=True):
    """Card of the robot for an authenticated client.

    Attributes:
        session: Number of this connection.
        can_record: Whether the robot has a folder for recordings.
    """

    session: int
    can_record: bool = False


class Refused(RobotMessage, frozen=True):
    """Refusal of a message.

    Attributes:
        reason: Reason, a sentence.
        seq: `seq` of the refused command or suggestion; None for any other message.
        fatal: Whether the connection ends.
    """

    reason: str
    seq: int | None = None
    fatal: bool = False


class Observation(RobotMessage, frozen=True):
    """Sensor values, and the state of the outputs.

    Attributes:
        seq: Number of the observation, larger than the one before.
        captured_ns: Capture time of the newest frame; without a frame, `state_ns`.
        state_ns: Time at which the state was read.
        sent_ns: Time at which the observation was sent.
        frame: The newest frame as JPEG; None without one, if sent before, or if not requested.
        frame_seq: Number of the frame; equal numbers mean the same frame. 0 for none yet.
        state: Numbers of the state layout.
        sources: Source of each quantity: name of the sensor, "estimated" or "absent".
        action_applied: Applied actions, in the order and units of the command, after caps, slew
            and reflexes.
        applied_seq: `seq` of the applied command; None if the client in control has none applied.
        applied_ns: Time at which that command reached the outputs.
        command_ns: Time at which that command arrived.
        stop_reason: Why no command is applied, or what changes it beyond slew and levels, or "".
        armed: Whether the robot is armed; otherwise commands move nothing.
        emergency: Whether an emergency stop is in force.
        emergencies: Number of emergency stops since the robot's start.
        holder: Name of the client in control; "" for none.
        mine: Whether this client has control.
        holder_role: Role of the client in control; "" for none.
        commanded: Values of the command in force, times its scale; empty for none.
        suggested: Values of the newest suggestion; empty for none.
        suggested_by: Name of the client that sent it; "" for none.
    """

    seq: int
    captured_ns: int
    state_ns: int
    sent_ns: int
    frame: bytes | None
    frame_seq: int
    state: tuple[float, ...]
    sources: dict[str, str]
    action_applied: tuple[float, ...]
    applied_seq: int | None
    applied_ns: int | None
    command_ns: int | None
    stop_reason: str
    armed: bool
    emergency: bool
    emergencies: int
    holder: str
    mine: bool
    holder_role: Literal["", "person", "program"] = ""
    commanded: tuple[float, ...] = ()
    suggested: tuple[float, ...] = ()
    suggested_by: str = ""


class Lease(RobotMessage, frozen=True):
    """The client in control, after a change or a refused request.

    Attributes:
        mine: Whether this client has control.
        holder: Name of the client in control; "" for none.
        reason: Reason for the change or the refusal, a sentence.
    """

    mine: bool
    holder: str
    reason: str = ""


class Event(RobotMessage, frozen=True):
    """Event on the robot, for people to read.

    Attributes:
        name: Kind of event, such as "emergency", "armed", "disarmed" or "bump".
        text: A sentence.
        at_ns: Time of the event.
    """

    name: str
    text: str
    at_ns: int


class Pong(RobotMessage, frozen=True):
    """Answer to a `Ping`, with its token and the robot's time."""

    token: int
    now_ns: int


class RecorderState(RobotMessage, frozen=True):
    """State of the recorder, sent at each change and once a second while recording.

    Attributes:
        episode: Id of the current or last episode; "" for none yet, and while a new one is made.
        recording: Whether steps are recorded.
        steps: Number of steps.
        dropped: Number of steps that were dropped.
        seconds: Time from the first step to the newest kept one, s.
        marks: Number of marks.
        text: Reason why the episode ended by itself, such as a full disk; "" otherwise.
    """

    episode: _Before = ""
    recording: bool = False
    steps: int = 0
    dropped: int = 0
    seconds: float = 0.0
    marks: int = 0
    text: str = ""


class EpisodeSummary(msgspec.Struct, frozen=True, kw_only=True):
    """One episode in a list.

    Attributes:
        id: Name of the episode's folder.
        steps: Number of steps.
        kept: Number of steps that are not dropped.
        seconds: Duration of the kept steps, s.
        closed: Whether it was closed; False for the episode being recorded.
        created: Start, ISO 8601 in UTC.
        driver: Name of the driver.
        outcome: How the episode ended, such as "collision", or ""; the error if it is unreadable.
    """

    id: _Episode
    steps: int = 0
    kept: int = 0
    seconds: float = 0.0
    closed: bool = False
    created: str = ""
    driver: str = ""
    outcome: str = ""


class Recordings(RobotMessage, frozen=True):
    """List of episodes, newest first.

    Attributes:
        episodes: At most `MAX_EPISODES` episodes.
        more: Whether there are older ones, see `Browse.before`.
    """

    episodes: tuple[EpisodeSummary, ...]
    more: bool = False


class Piece(RobotMessage, frozen=True):
    """Part of an episode, as it is on the robot's disk.

    Attributes:
        episode: Id of the episode.
        first: Number of the first line, as requested.
        total: Number of complete lines in `steps.jsonl` now.
        lines: Lines from `first` on, without line ends; fewer than requested at the end of the
            file, and if they would make the message too large.
        frames: JPEG of each line's `frame`; None without a frame, or if it is the same as in the
            previous line.
        header: Text of `episode.json` now.
    """

    episode: _Episode
    first: int
    total: int
    lines: tuple[str, ...]
    frames: tuple[bytes | None, ...]
    header: str = ""


class PolicyState(RobotMessage, frozen=True):
    """The policies on board, sent to a new client and at each change.

    Attributes:
        names: Names of the policies that can be started.
        running: Name of the running policy; "" for none.
        text: A sentence on its state, or why the last policy ended; may be empty.
    """

    names: tuple[str, ...]
    running: str = ""
    text: str = ""


encode: Final = msgspec.msgpack.Encoder().encode
"""Encode a message."""


def _decoded(decoder: msgspec.msgpack.Decoder[_M], limit: int, data: bytes) -> _M:
    if len(data) > limit:
        raise LinkError(f"A message of {len(data)} bytes is larger than the {limit} allowed.")
    with translate_errors(
        *(msgspec.MsgspecError, UnicodeDecodeError, RecursionError),
        to=lambda error: LinkError(f"Not a valid message: {error}."),
    ):
        return decoder.decode(data)


_OF_A_CLIENT: Final = msgspec.msgpack.Decoder(Union[*ClientMessage.__subclasses__()])
_OF_A_ROBOT: Final = msgspec.msgpack.Decoder(Union[*RobotMessage.__subclasses__()])

decode_client_message: Final = partial(_decoded, _OF_A_CLIENT, MAX_CLIENT_MESSAGE)
"""Decode a message of a client; raise `LinkError` for other bytes."""

decode_robot_message: Final = partial(_decoded, _OF_A_ROBOT, MAX_ROBOT_MESSAGE)
"""Decode a message of a robot; raise `LinkError` for other bytes."""
