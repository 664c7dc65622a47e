"""Messages between the daemon and the guard: one JSON object per datagram.

Both run on one machine, connected by a pair of `SOCK_SEQPACKET` sockets, which preserve message
boundaries, and share one monotonic clock. JSON, because the guard loads only the standard library.
"""

from __future__ import annotations

import dataclasses
import json
import math
from dataclasses import dataclass
from typing import Any, Final, Literal, cast

MAX_DATAGRAM: Final = 16 * 1024
"""Size of the largest datagram, bytes."""

_KINDS: Final = ("command", "halt", "arm", "disarm", "emergency", "end")


@dataclass(frozen=True, slots=True)
class Order:
    """Request from the daemon to the guard.

    Attributes:
        kind: "command" moves; "halt" takes the newest command back and leaves the robot armed;
            "arm" lets commands move, and ends an emergency stop; "disarm" ends that; "emergency"
            stops until armed again; "end" ends the guard.
        session: Number of the lease that it belongs to; commands of an older one are refused.
        seq: Number of a command; each is larger than the one before in its session.
        issued_ns: When the daemon received it. Needed for "command" and "arm", which are refused
            when they are old.
        ttl_ms: How long a command acts at most, counted from `issued_ns`.
        frame_ns: When the newest picture was taken; None without a camera or a picture.
        values: One number for each action.
        emergency: For "arm": how many emergency stops whoever arms has seen. One that came since
            is not ended.
        reason: Why, in words, for "disarm" and "emergency".
        person: For "arm": whether a person arms; only persons end an emergency stop.
    """

    kind: Literal["command", "halt", "arm", "disarm", "emergency", "end"]
    session: int = 0
    seq: int = 0
    issued_ns: int = 0
    ttl_ms: int = 0
    frame_ns: int | None = None
    values: tuple[float, ...] = ()
    emergency: int = 0
    reason: str = ""
    person: bool = False


@dataclass(frozen=True, slots=True)
class GuardState:
    """Report from the guard: what it applies and senses.

    Attributes:
        at_ns: Time of the report, ns.
        armed: Whether commands move anything.
        emergency: Whether an emergency stop is in force.
        emergencies: How many there were since the guard started; see `Order.emergency`.
        stop_reason: Why the command is not applied; empty if it is.
        applied: Applied value of each action.
        applied_session: Session of the underlying command.
        applied_seq: Its sequence number; None while the robot is at rest without a command.
        applied_ns: When it reached the outputs.
        refused: Why the newest command was refused; empty if none was since the last state.
        refused_seq: Its number.
        outputs: Value of each output, -1 to 1.
        quantities: Sensor readings in SI units, keyed by name: "speed" m/s signed, "distance" m,
            "bump" 0 or 1, "battery" V, "yaw_rate" rad/s, "acceleration_x" m/s2, "temperature" C,
            "stall" 0 or 1, "collision" 0 or 1; without those that nothing measures.
        sources: Where a quantity comes from: name of a sensor, or "estimated".
        bumps: How many bumps there were since the guard started.
    """

    at_ns: int
    armed: bool
    emergency: bool
    emergencies: int
    stop_reason: str
    applied: tuple[float, ...]
    applied_session: int
    applied_seq: int | None
    applied_ns: int | None
    refused: str
    refused_seq: int | None
    outputs: dict[str, float]
    quantities: dict[str, float]
    sources: dict[str, str]
    bumps: int


def encode(said: Order | GuardState) -> bytes:
    """Encode a message as one datagram."""
    # `asdict` would copy every value, in each tick of the guard.
    content = {field.name: getattr(said, field.name) for field in dataclasses.fields(said)}
    text = json.dumps(content, allow_nan=False, ensure_ascii=False, separators=(",", ":"))
    return text.encode(errors="replace")  # Half of a surrogate pair has no bytes.


def decode_order(data: bytes) -> Order:
    """Decode an order from the daemon."""
    fields = _fields(data)
    try:
        fields["values"] = tuple(fields.get("values", ()))
        order = Order(**fields)
    except TypeError as error:
        raise ValueError(f"Invalid order: {error}.") from error
    numbers = (order.session, order.seq, order.issued_ns, order.ttl_ms, order.emergency)
    if order.kind not in _KINDS or not all(type(number) is int for number in numbers):
        raise ValueError("Invalid order: unknown kind, or a field that must be an integer.")
    if not (order.frame_ns is None or type(order.frame_ns) is int):
        raise ValueError("Invalid order: frame_ns must be an integer.")
    if type(order.reason) is not str:
        raise ValueError("Invalid order: reason must be a string.")
    if type(order.person) is not bool:
        raise ValueError("Invalid order: person must be true or false.")
    if not all(_is_finite(value) for value in order.values):
        raise ValueError("Invalid order: every value must be a finite number.")
    return order


def decode_state(data: bytes) -> GuardState:
    """Decode a state from the guard."""
    fields = _fields(data)
    try:
        fields["applied"] = tuple(fields["applied"])
        return GuardState(**fields)
    except (KeyError, TypeError) as error:
        raise ValueError(f"Invalid state: {error}.") from error


def _is_finite(value: object) -> bool:
    if type(value) not in (int, float):
        return False
    try:
        return math.isfinite(cast("float", value))
    except OverflowError:  # An integer beyond the range of a float.
        return False


def _fields(data: bytes) -> dict[str, Any]:
    try:
        fields: object = json.loads(data)
    except (UnicodeDecodeError, RecursionError) as error:
        raise ValueError(f"Invalid JSON: {error}.") from error
    if not isinstance(fields, dict):
        raise ValueError("The message must be a JSON object.")
    return cast("dict[str, Any]", fields)
