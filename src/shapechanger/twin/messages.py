"""What the twin's board and its clients say to each other: one JSON object a datagram.

The socket is a Unix one of the kind `SOCK_SEQPACKET`, which keeps messages apart and in order. `op`
says what a message is; times are nanoseconds of the run's clock.

What a client says (with `id` where it waits for an answer):

```
hello   role, pid             "hardware", "clock" or "operator"; answered by clock, t
claim   id, pin, mode, pull, t   a pin as "input" or "output"; answered by level, or error: busy
pin     pin, duty, hz, t      level (hz 0) or software PWM of an output
pulse   pin, us, hz, t        servo pulses; 0 us for none; the pin is claimed with the first
read    id, bus, address, register, length       answered by data, or errno
write   id, bus, address, register, data, t      answered by nothing more, or errno
servo   id, device, data      bytes for the servo bus, hex; answered by data that came from it
wait    until                 done with what was granted; grant the next time
sleep   id, ns                let time go by; answered by t, captured_ns
bye                           a client that leaves on purpose
```

What an operator says besides, see `Operator`: `place`, `camera`, `press`, `battery`, `distance`,
`chip`, `servo_fault`, `magnet`, `tensions`, `levels` and `where`. It is answered after everything
that was said before.

What the board says:

```
reply   id, ...               the answer
inputs  edges                 [[pin, level, t], ...] of the inputs that were claimed
grant   t                     it is this time now: work, then wait
```
"""

from __future__ import annotations

import json
from typing import Any, Final, Protocol

__all__ = ["MAX_MESSAGE", "MOST_EDGES", "BoardLink", "EdgeListener", "Message", "decode", "encode"]

MAX_MESSAGE: Final = 64 * 1024
"""Bytes of the largest message."""

MOST_EDGES: Final = 500
"""How many edges one message holds, so that it stays below `MAX_MESSAGE`."""

Message = dict[str, Any]

_ENCODER: Final = json.JSONEncoder(allow_nan=False, separators=(",", ":"))
_DECODER: Final = json.JSONDecoder()


def encode(message: Message) -> bytes:
    """A message as bytes."""
    return _ENCODER.encode(message).encode()


def decode(data: bytes) -> Message:
    """The message that was sent by `encode`."""
    return _DECODER.decode(data.decode())


class EdgeListener(Protocol):
    """Is told of the edges of inputs."""

    def __call__(self, pin: int, level: int, at_ns: int, /) -> None:
        """A pin has changed to a level at a time."""
        ...


class BoardLink(Protocol):
    """A way to the board: a socket to another process, or the board itself in this one.

    Attributes:
        levels: Level of each pin that is claimed as an input.
        on_edge: Whom to tell of edges.
    """

    levels: dict[int, int]
    on_edge: EdgeListener | None

    @property
    def closed(self) -> bool:
        """Whether it was closed here."""
        ...

    def post(self, **message: Any) -> None:
        """Say something that needs no answer."""
        ...

    def ask(self, **message: Any) -> Message:
        """Say something and get the answer."""
        ...

    def drain(self) -> None:
        """Take in everything that has arrived, without waiting."""
        ...
