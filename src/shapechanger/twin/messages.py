"""Messages between a board and its clients, one MessagePack object per datagram.

They travel over a Unix socket of type `SOCK_SEQPACKET`, which keeps datagrams separate and in
order. Times are nanoseconds of the run's clock. A request with an `id` is answered by one
`BoardReply`; a request without is only reported in the board's log if it fails. Requests of an
operator are answered after every request that a robot's process sent before them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple, Protocol

import msgspec

MAX_MESSAGE: Final = 64 * 1024
"""Size of the largest message in bytes."""

MAX_EDGES: Final = 500
"""Most edges in one message, so that it stays below `MAX_MESSAGE`."""

Role = Literal["hardware", "operator", "clock"]
"""A robot's process, a person beside the robot, or a connection that only sleeps."""


class Edge(NamedTuple):
    """A change of an input pin.

    Attributes:
        t: Time of the change, ns.
        pin: BCM number.
        level: Level from then on, 0 or 1.
    """

    t: int
    pin: int
    level: int


class Whereabouts(NamedTuple):
    """True state of the vehicle.

    Attributes:
        x: Position, m.
        y: Position, m.
        heading: Angle from the x axis, rad, counter-clockwise seen from above.
        speed: Speed along the heading, m/s.
        travelled_m: Distance rolled by the wheels, m; driving backward counts down.
        bumped: Whether something presses the bumper.
        distance_m: Free distance ahead of the nose, m.
        truth: Quantities that no sensor measures, such as the progress along a course, by name.
        t: Time, ns.
    """

    x: float
    y: float
    heading: float
    speed: float
    travelled_m: float
    bumped: bool
    distance_m: float
    truth: dict[str, float]
    t: int


class _Request(msgspec.Struct, tag_field="op", tag=True, kw_only=True, omit_defaults=True):
    """A message to the board; `id` is set where the client waits for the reply."""

    id: int | None = None


class ConnectClient(_Request):
    """First message of a client, answered by `BoardGreeting`."""

    role: Role
    pid: int


class _PinRequest(_Request, kw_only=True):
    """A request about a pin or chip, at a time in ns; a board with a twin's clock sets its own."""

    t: int = 0


class ClaimPin(_PinRequest):
    """Claim a pin, answered by its level; refused while another process holds it.

    Attributes:
        pin: BCM number.
        mode: What the pin is from now on.
        pull: Pull of an input: "up", "down" or "floating".
        level: First level of an output.
    """

    pin: int
    mode: Literal["input", "output"]
    pull: str = "floating"
    level: int = 0


class DrivePin(_PinRequest):
    """Set the level of an output (`hz` 0), or the duty of its software PWM."""

    pin: int
    duty: float
    hz: int


class PulsePin(_PinRequest):
    """Send servo pulses on an output; a width of 0 us ends them."""

    pin: int
    us: int
    hz: int


class ReadChip(_PinRequest):
    """Read registers of an I2C chip, answered by their bytes; an `errno` if no chip answers."""

    bus: int
    address: int
    register: int
    length: int


class WriteChip(_PinRequest):
    """Write registers of an I2C chip; an `errno` if no chip answers."""

    bus: int
    address: int
    register: int
    data: list[int]


class ExchangeServoBytes(_Request):
    """Send bytes to the servo bus, answered by the bytes that have arrived from it."""

    device: str
    data: bytes


class WaitForGrant(_Request):
    """Finish the current grant and wait for the next, due at `until_ns` at the latest."""

    until_ns: int


class SleepOnBoard(_Request):
    """Let the twin's time advance, answered by `SleepResult` when it has."""

    ns: int


class LeaveBoard(_Request):
    """Last message of a client that closes its connection in order."""


class PlaceVehicle(_Request):
    """Place the vehicle at the start that follows from a seed."""

    seed: int


class PutVehicleBack(_Request):
    """Put a vehicle that has collided back on its lane."""


class LayOutCourse(_Request):
    """Replace the surroundings of the vehicle."""

    seed: int


class BreakCamera(_Request):
    """Make the camera fail; "" repairs it."""

    fault: str


class PressButton(_Request):
    """Press or release all bumpers ("bumper") or the stop button ("stop")."""

    button: str
    down: bool


class SetBattery(_Request):
    """Set the battery's voltage without load; None for a full one."""

    volts: float | None


class SetDistance(_Request):
    """Override what distance sensors measure; None restores the truth, `dead` silences them."""

    metres: float | None
    dead: bool


class BreakChip(_Request):
    """Make an I2C chip stop answering, or answer again."""

    bus: int
    address: int
    dead: bool


class BreakServo(_Request):
    """Make the servo of a tendon fail; "" repairs what can be repaired."""

    tendon: str
    fault: str


class BreakMagnet(_Request):
    """Change the magnet of a joint's encoder; "" repairs it."""

    joint: str
    fault: str


class ReadTensions(_Request):
    """Ask for the tension of each tendon, N, by name."""


class ReadLevels(_Request):
    """Ask for the state of all outputs, a `Levels`."""


class ReadWhereabouts(_Request):
    """Ask for the true state of the vehicle, a `Whereabouts`."""


PinRequest = ClaimPin | DrivePin | PulsePin | ReadChip | WriteChip

Request = (
    ConnectClient
    | PinRequest
    | ExchangeServoBytes
    | WaitForGrant
    | SleepOnBoard
    | LeaveBoard
    | PlaceVehicle
    | PutVehicleBack
    | LayOutCourse
    | BreakCamera
    | PressButton
    | SetBattery
    | SetDistance
    | BreakChip
    | BreakServo
    | BreakMagnet
    | ReadTensions
    | ReadLevels
    | ReadWhereabouts
)


class BoardGreeting(msgspec.Struct, frozen=True):
    """Answer to `ConnectClient`: the kind of clock, and its time."""

    clock: Literal["real", "twin"]
    t: int


class SleepResult(msgspec.Struct, frozen=True):
    """Answer to `SleepOnBoard`: the time, and when the newest picture was taken, if any was."""

    t: int
    captured_ns: int | None


class _Event(msgspec.Struct, tag_field="op", tag=True, omit_defaults=True, frozen=True):
    """A message from the board."""


class BoardReply(_Event, frozen=True):
    """Answer to one request: an encoded result, an error message or an `errno`."""

    id: int
    result: msgspec.Raw = msgspec.Raw(b"\xc0")  # None.
    error: str = ""
    errno: int = 0


class InputEdges(_Event, frozen=True):
    """Edges of the inputs that the client has claimed, in order of time."""

    edges: list[Edge]


class GrantTime(_Event, frozen=True):
    """Twin time until which the client may work; then it waits again."""

    t: int


BoardEvent = BoardReply | InputEdges | GrantTime

encode = msgspec.msgpack.encode
decode_request: Callable[[bytes], Request] = msgspec.msgpack.Decoder(Request).decode
decode_event: Callable[[bytes], BoardEvent] = msgspec.msgpack.Decoder(BoardEvent).decode


class BoardPins(Protocol):
    """Pins and chips of a board: in this process, or over the socket of another.

    Attributes:
        levels: Level of each pin that is claimed as an input.
        on_edge: Called with pin, level and time of each edge.
    """

    levels: dict[int, int]
    on_edge: Callable[[int, int, int], None] | None

    @property
    def closed(self) -> bool:
        """True if `close` was called."""
        ...

    def post(self, request: PinRequest) -> None:
        """Send a request that has no result."""
        ...

    def ask(self, request: PinRequest, kind: Any = None) -> Any:
        """Send a request and return its result.

        Args:
            request: The request.
            kind: Type of the result.

        Raises:
            RobotError: If the board refuses it.
            OSError: If no chip answers.
        """
        ...

    def drain(self) -> None:
        """Receive everything that has arrived, without waiting."""
        ...

    def close(self) -> None:
        """Let go of everything."""
        ...
