"""Observations and messages of clients; `test_session_stateful.py` tests the rules of control."""

import math
from collections.abc import Callable

import pytest

from shapechanger.errors import RobotRefused
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon import session
from shapechanger.robot.daemon.client import Client
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.guard.channel import GuardState, Order
from shapechanger.robot.link import messages as link
from tests.robot.daemon.fakes import SteppedClock
from tests.robot.daemon.plans import car_plan, guard_state

ANN, SAC = Client(1, "Ann", "person"), Client(3, "sac")


def new_hub(order: Callable[[Order], object] = lambda order: None) -> SessionHub:
    """Return the hub of a car; the robot's time is 50 ns."""
    clock = SteppedClock()
    clock.ns = 50
    return SessionHub(car_plan(), clock, order)


def observed(hub: SessionHub, frame_sent: int | None = 0) -> link.Observation:
    return hub.observation(ANN, 7, frame_sent)


def seen_at_50_ns(
    state: GuardState | None = None, *, frames: int = 3, frame_sent: int | None = 0
) -> link.Observation:
    """Build an observation at 50 ns, from a state of 40 ns and a frame of 30 ns."""
    hub = new_hub()
    for _ in range(frames):
        hub.on_frame(Frame(b"jpeg", 30))
    hub.on_state(guard_state(at_ns=40) if state is None else state)
    return observed(hub, frame_sent)


def test_unknown_quantities_are_nan() -> None:
    seen = seen_at_50_ns(guard_state(applied=(0.1, 0.5)))
    assert seen.state[0] == 0.25
    assert math.isnan(seen.state[1])
    assert seen.state[2] == 0.5
    assert seen.sources == {"speed": "wheel", "distance": "absent"}
    seen = observed(new_hub())  # The guard has sent no state.
    assert all(map(math.isnan, seen.state))
    assert "guard" in seen.stop_reason
    assert not seen.armed
    assert seen.state_ns == 50


def test_a_frame_is_sent_once_to_each_client_that_requests_frames() -> None:
    assert seen_at_50_ns().frame == b"jpeg"
    again = seen_at_50_ns(frame_sent=3)
    assert (again.frame, again.frame_seq, again.captured_ns) == (None, 3, 30)
    declined = seen_at_50_ns(frame_sent=None)
    assert (declined.frame, declined.captured_ns) == (None, 30)
    blind = seen_at_50_ns(frames=0)  # Its capture time is the time of the state.
    assert (blind.frame, blind.frame_seq, blind.captured_ns) == (None, 0, 40)


def test_a_command_of_an_earlier_lease_is_not_reported() -> None:
    """The guard gets the scaled values, the lifetime, and the time of the newest frame."""
    orders: list[Order] = []
    hub = new_hub(orders.append)
    hub.take(ANN)
    hub.on_frame(Frame(b"jpeg", 30))
    hub.command(ANN, link.Command(seq=9, answers=1, values=(0.0, 0.5), scale=0.5, ttl_ms=80))
    hub.on_state(guard_state(applied=(0.0, 0.5), applied_session=1, applied_seq=9, applied_ns=39))
    (order,) = orders
    assert (order.values, order.ttl_ms, order.frame_ns) == ((0.0, 0.25), 80, 30)
    own = observed(hub)
    assert (own.applied_seq, own.applied_ns, own.command_ns) == (9, 39, 50)
    hub.release(ANN, "she went")
    hub.take(SAC)
    other = observed(hub)
    assert (other.applied_seq, other.applied_ns, other.command_ns) == (None, None, None)
    assert other.action_applied == (0.0, 0.5)


def test_a_person_can_always_connect() -> None:
    """Programs are limited to 6; at 8 clients, a person removes the oldest without control."""
    hub, programs = new_hub(), [Client(number) for number in range(6)]
    people = [Client(10 + number, f"person {number}", "person") for number in range(3)]
    for client in programs:
        hub.join(client)
    hub.take(programs[0])
    with pytest.raises(RobotRefused, match="only a person can still connect"):
        hub.join(Client(6))
    for client in people:
        hub.join(client)
    with pytest.raises(RobotRefused, match="8 clients are connected"):
        hub.join(Client(6))
    reason = "person 2 connected, and 8 clients are the limit."
    assert [one.expelled for one in (*programs, *people)] == ["", reason, *[""] * 7]
    assert hub.holder is programs[0]


def test_a_client_may_send_one_second_of_messages_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "monotonic", lambda: 0.0)
    one = Session(1, new_hub(), Authenticator(), 10.0)
    one.introduce(link.encode(link.Hello(version=link.VERSION, proof=b"")))
    for now_s, count in ((0.0, 10), (0.25, 2), (9.0, 10)):
        monkeypatch.setattr(session, "monotonic", lambda now_s=now_s: now_s)
        for _ in range(count):
            one.receive(link.encode(link.Ping()))
        with pytest.raises(RobotRefused, match="Too many messages"):
            one.receive(link.encode(link.Ping()))


def test_a_client_keeps_the_newest_lease_and_events() -> None:
    client = Client(1)
    client.post(link.Lease(mine=True, holder="a"))
    client.post(link.Pong(token=1, now_ns=0))
    client.post(link.Lease(mine=False, holder="b"))
    for number in range(1_000):
        client.post(link.Event(name="bump", text="", at_ns=number))
    events = [link.Event(name="bump", text="", at_ns=number) for number in range(968, 1_000)]
    kept = [link.Pong(token=1, now_ns=0), link.Lease(mine=False, holder="b"), *events]
    assert list(iter(client.take, None)) == kept


def test_a_client_with_too_many_unread_answers_is_expelled() -> None:
    client = Client(1)
    for number in range(256):
        client.post(link.Pong(token=number, now_ns=0))
    assert client.expelled == ""
    client.post(link.Pong(token=256, now_ns=0))
    assert client.expelled == "The client does not read its messages."
    client.post(link.Event(name="bump", text="", at_ns=0))
    assert len(list(iter(client.take, None))) == 257
