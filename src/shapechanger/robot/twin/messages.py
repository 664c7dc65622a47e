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

from shapechanger.robot.drivers.simulation import Edge

MAX_MESSAGE: Final = 64 * 1024
"""Size of the largest message in bytes."""

MAX_EDGES: Final = 500
"""Most edges in one message, so that it stays below `MAX_MESSAGE`."""

Role = Literal["hardware", "operator", "clock"]
"""A robot's process, a person beside the robot, or a connection that only sleeps."""


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


class _HardwareRequest(_Request, kw_only=True):
    """A request of a robot's process, at a time in ns; a board with a twin's clock sets its own."""

    t: int = 0


class ClaimPin(_HardwareRequest):
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


class DrivePin(_HardwareRequest):
    """Set the level of an output (`hz` 0), or the duty of its software PWM."""

    pin: int
    duty: float
    hz: int


class PulsePin(_HardwareRequest):
    """Send servo pulses on an output; a width of 0 us ends them."""

    pin: int
    us: int
    hz: int


class ReadChip(_HardwareRequest):
    """Read registers of an I2C chip, answered by their bytes; an `errno` if no chip answers."""

    bus: int
    address: int
    register: int
    length: int


class WriteChip(_HardwareRequest):
    """Write registers of an I2C chip; an `errno` if no chip answers."""

    bus: int
    address: int
    register: int
    data: list[int]


class InstructServos(_HardwareRequest):
    """Read `size` bytes of servos, or write `data`, answered by their replies by id."""

    device: str
    at: int
    ids: list[int]
    size: int = 0
    data: list[bytes] = []


class WaitForGrant(_Request):
    """Finish the current grant and wait for the next, due at `until_ns` at the latest."""

    until_ns: int


class SleepOnBoard(_Request):
    """Let the twin's time advance, answered by `SleepResult` when it has."""

    ns: int


class LeaveBoard(_Request):
    """Last message of a client that closes its connection in order."""


class OperatorRequest(_Request):
    """Do what a person beside the robot does, or read the truth; see `Operator`.

    Attributes:
        action: What to do.
        values: Arguments of the action.
    """

    action: str
    values: tuple[bool | int | float | str | None, ...] = ()


HardwareRequest = ClaimPin | DrivePin | PulsePin | ReadChip | WriteChip | InstructServos

Request = (
    ConnectClient | HardwareRequest | WaitForGrant | SleepOnBoard | LeaveBoard | OperatorRequest
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
    """Pins, chips and servos of a board: in this process, or over the socket of another.

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

    def post(self, request: HardwareRequest) -> None:
        """Send a request that has no result."""
        ...

    def ask(self, request: HardwareRequest, kind: Any = None) -> Any:
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
