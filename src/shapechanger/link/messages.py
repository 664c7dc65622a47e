"""The messages between a program or a person and a robot, one binary WebSocket message each.

A message is a msgpack map with its kind under `kind`; JPEG bytes travel as they are. Unknown keys
are ignored, so that a newer minor version can be understood; unknown kinds are refused.

How a connection goes:

```
robot   Challenge          who I am, which version, a nonce
client  Hello              which version, who I am, the proof that I hold the key
robot   Welcome | Refused  what I sense and move; or why not, and the connection ends
client  Take               may I command? Answered by Lease
client  Arm                (a person, by default) the outputs may move from now on
robot   Observation        the newest one, each time the client has credit
client  Command            what to do, in answer to which observation; gives credit for the next
client  Suggest            what it would do, while somebody else commands; gives credit too
client  Record Mark Undo   (a person) what is driven becomes an episode on the robot's disk
robot   RecorderState      how that goes, to everybody
client  Browse Fetch Judge what was recorded: the list, a piece of an episode, steps good or bad
robot   Recordings Piece   the answers
```

Times are nanoseconds of the robot's monotonic clock. Two machines' clocks are never subtracted: how
late a command is follows from the observation that it answers, because the robot knows when it
sent that one.
"""

from __future__ import annotations

from typing import Annotated, Final, Literal, TypeVar

import msgspec
from msgspec import Meta

from shapechanger.errors import LinkError

__all__ = [
    "MAX_CLIENT_MESSAGE",
    "MAX_EPISODES",
    "MAX_PIECE",
    "MAX_ROBOT_MESSAGE",
    "VERSION",
    "Acknowledge",
    "Arm",
    "Browse",
    "Challenge",
    "ClientMessage",
    "Command",
    "Disarm",
    "EmergencyStop",
    "EpisodeSummary",
    "Event",
    "Fetch",
    "Hello",
    "Judge",
    "Lease",
    "Mark",
    "Observation",
    "Piece",
    "Ping",
    "Pong",
    "Record",
    "RecorderState",
    "Recordings",
    "Refused",
    "Release",
    "RobotMessage",
    "Role",
    "Suggest",
    "Take",
    "Undo",
    "Welcome",
    "decode_client_message",
    "decode_robot_message",
    "encode",
]

VERSION: Final = 1
"""Version of the messages; both sides must have the same."""

MAX_CLIENT_MESSAGE: Final = 64 * 1024
"""Bytes of the largest message that a robot reads; a larger one is an attack or a bug."""

MAX_ROBOT_MESSAGE: Final = 4 * 1024 * 1024
"""Bytes of the largest message that a client reads."""

MAX_PIECE: Final = 256 * 1024
"""Bytes of a `Piece`, about: it ends with the line that reaches them. Larger ones would keep
observations waiting on a slow radio."""

MAX_EPISODES: Final = 200
"""Episodes in one `Recordings`; `Browse.before` asks for those before."""

Role = Literal["person", "program"]
"""Who drives. A person takes the robot from a program at once; never the other way round."""

Pace = Literal["realtime", "lockstep"]
"""Who keeps the time: the robot and the client each on their own, or the robot waits for a command
and answers with the observation one control period later."""

_M = TypeVar("_M")

# Names come from people, and end up in logs and on screens.
_Name = Annotated[str, Meta(max_length=64)]
_Words = Annotated[str, Meta(max_length=1024)]
_Sequence = Annotated[int, Meta(ge=0, le=2**53)]
_Values = Annotated[tuple[float, ...], Meta(max_length=64)]
# One folder of the recordings and never another one: no separator, and no dot in front.
_Episode = Annotated[str, Meta(max_length=128, pattern=r"^[0-9A-Za-z][0-9A-Za-z._-]*\Z")]
_Before = Annotated[str, Meta(max_length=128, pattern=r"^([0-9A-Za-z][0-9A-Za-z._-]*)?\Z")]
_Step = Annotated[int, Meta(ge=0, le=2**53)]


class _Message(msgspec.Struct, frozen=True, tag_field="kind", tag=str.lower, kw_only=True):
    """Something that is said in one go."""

    def __repr__(self) -> str:
        """Its fields, of bytes only how many: neither pictures nor proofs belong in a log."""
        fields = (f"{name}={_shown(getattr(self, name))}" for name in self.__struct_fields__)
        return f"{type(self).__name__}({', '.join(fields)})"


# What a client says.


class Hello(_Message, frozen=True):
    """The first message of a client.

    Attributes:
        version: Version of the messages that the client speaks.
        proof: Answer to the challenge, see `shapechanger.link.authentication`.
        name: Who it is, for people to read.
        role: Who drives.
        pace: Who keeps the time.
        frames: Whether observations shall carry pictures.
    """

    version: int
    proof: Annotated[bytes, Meta(max_length=64)]
    name: _Name = ""
    role: Role = "program"
    pace: Pace = "realtime"
    frames: bool = True


class Command(_Message, frozen=True):
    """What the robot shall do until the next command, or until it is too old.

    Attributes:
        seq: Number of the command; each is larger than the one before.
        answers: `seq` of the observation that it was decided on.
        values: One number for each action of the robot, in the order of its action layout.
        ttl_ms: How long the command may act, counted from its arrival; the robot's own deadline
            holds where it is shorter.
        scale: The client's own cap, 0 to 1, times the values; it can only lower what the robot
            allows.
    """

    seq: _Sequence
    answers: _Sequence
    values: _Values
    ttl_ms: Annotated[int, Meta(ge=1, le=60_000)] = 1_000
    scale: Annotated[float, Meta(ge=0.0, le=1.0)] = 1.0


class Acknowledge(_Message, frozen=True):
    """Asks for the next observation without commanding anything.

    Attributes:
        seq: `seq` of the observation that was received; 0 for none yet.
    """

    seq: _Sequence = 0


class Take(_Message, frozen=True):
    """Asks to be the one who commands."""


class Release(_Message, frozen=True):
    """Gives the command back; the robot stops and disarms."""


class Arm(_Message, frozen=True):
    """Lets the outputs move; from a person it also ends an emergency stop.

    Attributes:
        answers: `seq` of an observation that was received just now, as in a command: one that was
            long on its way must not arm a robot that nobody looks at any more.
        emergency: How many emergency stops the sender has seen (`Observation.emergencies`). One
            that came since is not ended, because the sender did not know of it.
    """

    answers: _Sequence
    emergency: _Sequence = 0


class Disarm(_Message, frozen=True):
    """Keeps the outputs at rest from now on."""


class EmergencyStop(_Message, frozen=True):
    """Stops everything, whoever commands, until a person arms the robot again.

    Attributes:
        reason: Why, for people to read.
    """

    reason: _Words = ""


class Ping(_Message, frozen=True):
    """Asks for a `Pong`.

    Attributes:
        token: Comes back as it is.
    """

    token: _Sequence = 0


class Suggest(_Message, frozen=True):
    """What a client that does not command would do now; the robot does not do it.

    It is shown to everybody (`Observation.suggested`), recorded as what a policy wanted, and gives
    credit for the next observation, as a command does. The robot forgets it after its
    `Welcome.deadline_ms`, and when its sender leaves or commands.

    Attributes:
        seq: Number of the suggestion; each is larger than the one before. A refusal names it.
        answers: `seq` of the observation that it was decided on.
        values: One number for each action of the robot, in the order of its action layout.
    """

    seq: _Sequence
    answers: _Sequence
    values: _Values


class Record(_Message, frozen=True):
    """Begins or ends an episode on the robot's disk; only a person may.

    Answered by `RecorderState`, which everybody gets, or by `Refused`. Whoever commands is
    recorded, a person or a program, whenever the outputs may move; when the last person leaves, it
    ends.

    Attributes:
        on: Whether to record from now on.
        name: What the episode is about, for people to read.
    """

    on: bool
    name: _Name = ""


class Mark(_Message, frozen=True):
    """Puts a mark on the newest step of the episode that is being recorded; only a person may.

    Attributes:
        text: What it says.
    """

    text: _Words = ""


class Undo(_Message, frozen=True):
    """Drops the newest steps of the episode that is being recorded; only a person may.

    They stay on the disk, and are not learned from.

    Attributes:
        seconds: How far back.
    """

    seconds: Annotated[float, Meta(gt=0.0, le=3_600.0)] = 5.0


class Browse(_Message, frozen=True):
    """Asks for the list of the robot's recordings; answered by `Recordings`.

    Attributes:
        before: Only episodes whose id sorts before this one; empty for the newest.
    """

    before: _Before = ""


class Fetch(_Message, frozen=True):
    """Asks for a part of an episode; answered by `Piece`.

    One question about recordings at a time: the next one is refused until the answer has left.

    Attributes:
        episode: Its id.
        first: Number of the first line of `steps.jsonl`, from 0.
        count: How many lines at most.
    """

    episode: _Episode
    first: _Step = 0
    count: Annotated[int, Meta(ge=1, le=100_000)] = 1_000


class Judge(_Message, frozen=True):
    """Says that steps of an episode are bad, or good after all; only a person may.

    Answered by `Recordings` with that episode alone.

    Attributes:
        episode: Its id; not of the one that is being recorded.
        first: Number of the first step.
        last: Number of the last step, which counts too.
        keep: Whether they are to be learned from.
    """

    episode: _Episode
    first: _Step
    last: _Step
    keep: bool = False


ClientMessage = (
    Hello
    | Command
    | Acknowledge
    | Take
    | Release
    | Arm
    | Disarm
    | EmergencyStop
    | Ping
    | Suggest
    | Record
    | Mark
    | Undo
    | Browse
    | Fetch
    | Judge
)


# What a robot says.


class Challenge(_Message, frozen=True):
    """The first message of a robot.

    Attributes:
        version: Version of the messages that the robot speaks.
        nonce: What the proof is made from; new for each connection.
        robot: Name of the robot.
    """

    version: int
    nonce: bytes
    robot: str


class Welcome(_Message, frozen=True):
    """The client is known; this is what the robot is.

    Attributes:
        robot: Name of the robot.
        body: What it is, such as "car".
        action_layout: JSON of the `Layout` of `Command.values`.
        state_layout: JSON of the `Layout` of `Observation.state`.
        image_size: Width and height of the pictures in pixels; None without a camera.
        control_hz: How many commands a second the robot expects.
        deadline_ms: How long the newest command acts at most.
        max_observation_age_ms: How old an observation may be that a command answers.
        reward: Weights of the task, from the robot's profile, by name.
        reset: Commands that bring the robot back, from its profile: the values of a step and how
            many seconds it lasts; empty for none.
        arming: Who may arm it.
        clock: Where its time comes from.
        session: Number of this connection.
        can_record: Whether it has a place to keep recordings.
    """

    robot: str
    body: str
    action_layout: str
    state_layout: str
    image_size: tuple[int, int] | None
    control_hz: float
    deadline_ms: int
    max_observation_age_ms: int
    reward: dict[str, float]
    reset: tuple[tuple[tuple[float, ...], float], ...]
    arming: Literal["person", "anyone"]
    clock: Literal["real", "twin"]
    session: int
    can_record: bool = False


class Refused(_Message, frozen=True):
    """Something that the robot does not do.

    Attributes:
        reason: Why, in a sentence.
        seq: `seq` of the command that is refused; None for anything else.
        fatal: Whether the connection ends.
    """

    reason: str
    seq: int | None = None
    fatal: bool = False


class Observation(_Message, frozen=True):
    """What the robot senses, and what it did.

    Attributes:
        seq: Number of the observation; each is larger than the one before.
        captured_ns: When the picture was taken; when the state was read, without a picture.
        state_ns: When the state was read.
        sent_ns: When this left.
        frame: The picture as JPEG; None where there is none that is newer than the last one sent.
        frame_seq: Number of the picture; the same number is the same picture. 0 for none yet.
        state: The numbers of the state layout.
        sources: Where a quantity comes from: name of the sensor, "estimated" or "absent".
        action_applied: What the outputs do now, in the order and units of the command, after caps,
            slew and reflexes.
        applied_seq: `seq` of the command behind it; None while the robot stands still by itself.
        applied_ns: When that command reached the outputs.
        command_ns: When that command arrived.
        stop_reason: Why the robot does not do what it was told, in words; empty when it does.
        armed: Whether the outputs may move.
        emergency: Whether an emergency stop is in force.
        emergencies: How many emergency stops there were since the robot's start.
        holder: Name of whoever commands; empty for nobody.
        mine: Whether that is this client.
        holder_role: Who drives; empty for nobody.
        commanded: The newest command that is in force, times its scale, in the order and units of
            the command; empty for none.
        suggested: What a client that does not command would do; empty for none.
        suggested_by: Who that is, for people to read; empty for none.
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


class Lease(_Message, frozen=True):
    """Who commands from now on.

    Attributes:
        mine: Whether that is this client.
        holder: Name of whoever commands; empty for nobody.
        reason: Why it changed, or why it did not, in words.
    """

    mine: bool
    holder: str
    reason: str = ""


class Event(_Message, frozen=True):
    """Something that happened, for people to read.

    Attributes:
        name: What it was, such as "emergency", "armed", "disarmed" or "bump".
        text: A sentence.
        at_ns: When.
    """

    name: str
    text: str
    at_ns: int


class Pong(_Message, frozen=True):
    """The answer to a `Ping`.

    Attributes:
        token: As it came.
        now_ns: The robot's time.
    """

    token: int
    now_ns: int


class RecorderState(_Message, frozen=True):
    """How the recording goes: at each change, and once a second while it goes on.

    Attributes:
        episode: Id of the episode; of the last one, after it ended; empty for none yet, and while
            the disk makes a new one.
        recording: Whether steps are recorded.
        steps: How many there are.
        dropped: How many of them were undone.
        seconds: From its first step to the newest that counts, s.
        marks: How many marks there are.
        text: Why it ended by itself, such as a full disk, in a sentence; empty otherwise.
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
        id: Name of its folder.
        steps: How many steps it has.
        kept: How many of them are not dropped.
        seconds: How long the steps that are kept last, s.
        closed: Whether it was ended properly; one that is being recorded was not.
        created: When it began, ISO 8601 in UTC.
        driver: Who drove, for people to read.
        outcome: How it ended, such as "collision"; empty for just ended. Of one that cannot be
            read, why not.
    """

    id: _Episode
    steps: int
    kept: int
    seconds: float
    closed: bool
    created: str
    driver: str
    outcome: str


class Recordings(_Message, frozen=True):
    """What was recorded, newest first.

    Attributes:
        episodes: At most `MAX_EPISODES` of them.
        more: Whether there are older ones, see `Browse.before`.
    """

    episodes: tuple[EpisodeSummary, ...]
    more: bool = False


class Piece(_Message, frozen=True):
    """A part of an episode, as it is on the robot's disk.

    Attributes:
        episode: Its id.
        first: Number of the first line, as in the question.
        total: How many complete lines `steps.jsonl` has now.
        lines: The lines from `first` on, without their ends; none behind the last one. Fewer than
            were asked for where they would make a message that is too large.
        frames: For each line the JPEG that its `frame` names; None where it names none, or the same
            as the line before in this piece.
        header: The text of `episode.json` now.
    """

    episode: _Episode
    first: int
    total: int
    lines: tuple[str, ...]
    frames: tuple[bytes | None, ...]
    header: str = ""


RobotMessage = (
    Challenge
    | Welcome
    | Refused
    | Observation
    | Lease
    | Event
    | Pong
    | RecorderState
    | Recordings
    | Piece
)

_ENCODER: Final = msgspec.msgpack.Encoder()
_CLIENT_DECODER: Final = msgspec.msgpack.Decoder(ClientMessage)
_ROBOT_DECODER: Final = msgspec.msgpack.Decoder(RobotMessage)


def encode(message: ClientMessage | RobotMessage) -> bytes:
    """A message as bytes."""
    return _ENCODER.encode(message)


def decode_client_message(data: bytes) -> ClientMessage:
    """What a client said.

    Raises:
        LinkError: If these bytes are too many or no message of a client.
    """
    return _decoded(_CLIENT_DECODER, data, MAX_CLIENT_MESSAGE)


def decode_robot_message(data: bytes) -> RobotMessage:
    """What a robot said.

    Raises:
        LinkError: If these bytes are too many or no message of a robot.
    """
    return _decoded(_ROBOT_DECODER, data, MAX_ROBOT_MESSAGE)


def _shown(value: object) -> str:
    return f"<{len(value)} bytes>" if isinstance(value, bytes) else repr(value)


def _decoded(decoder: msgspec.msgpack.Decoder[_M], data: bytes, limit: int) -> _M:
    if len(data) > limit:
        raise LinkError(f"A message of {len(data)} bytes is larger than the {limit} allowed.")
    try:
        return decoder.decode(data)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise LinkError(f"This is no message: {error}.") from error
