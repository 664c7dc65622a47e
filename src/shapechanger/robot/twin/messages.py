"""Messages between a board and its clients, one MessagePack object per datagram.

They travel over a Unix socket of type `SOCK_SEQPACKET`, which keeps datagrams separate and in
order. A client calls functions of the board, whose arguments are decoded by the types of the
function. Times are nanoseconds of the run's clock.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal, NamedTuple

import msgspec

from shapechanger.robot.drivers.simulation import Edge

MAX_MESSAGE: Final = 64 * 1024
"""Size of the largest message in bytes."""

Role = Literal["hardware", "operator", "clock"]
"""A robot's process, a person next to the robot, or a connection that only sleeps."""


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
        truth: Quantities that no sensor measures, such as the progress along a course, keyed by
            name.
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


class Call(msgspec.Struct, frozen=True, omit_defaults=True):
    """A call of a function of the board.

    Attributes:
        function: Its name.
        arguments: Its encoded arguments.
        id: Id of the `Reply`; None if the client waits for none, and the board only logs failures.
        t: Time of the call, ns; a board with a twin's clock uses its own.
    """

    function: str
    arguments: msgspec.Raw
    id: int | None = None
    t: int = 0


class Greeting(msgspec.Struct, frozen=True):
    """Result of the first call: the kind of clock, and its time."""

    clock: Literal["real", "twin"]
    t: int


class Slept(msgspec.Struct, frozen=True):
    """Result of a sleep: the time, and when the newest frame was taken, if any was."""

    t: int
    captured_ns: int | None


class Reply(msgspec.Struct, tag=True, frozen=True, omit_defaults=True):
    """End of a call: an encoded result, an error message or an `errno`."""

    id: int
    result: msgspec.Raw = msgspec.Raw(b"\xc0")  # None.
    error: str = ""
    errno: int = 0


class InputEdges(msgspec.Struct, tag=True, frozen=True):
    """Edges of the inputs that the client has claimed, in order of time."""

    edges: list[Edge]


class Grant(msgspec.Struct, tag=True, frozen=True):
    """Twin time until which the client may work; then it waits again."""

    t: int


Event = Reply | InputEdges | Grant

encode = msgspec.msgpack.encode
decode_call: Callable[[bytes], Call] = msgspec.msgpack.Decoder(Call).decode
decode_event: Callable[[bytes], Event] = msgspec.msgpack.Decoder(Event).decode


def encode_call(function: str, *arguments: object, id: int | None = None, t: int = 0) -> bytes:
    """Return an encoded `Call`."""
    return encode(Call(function, msgspec.Raw(encode(arguments)), id, t))
