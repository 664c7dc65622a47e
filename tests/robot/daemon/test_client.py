"""Messages that wait for a client, and how many it may send."""

import pytest

from shapechanger.errors import RobotRefused
from shapechanger.robot.daemon import session
from shapechanger.robot.daemon.client import Client
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link.messages import VERSION, Event, Hello, Lease, Ping, Pong, encode
from tests.robot.daemon.plans import car_plan


def test_a_client_may_send_one_second_of_messages_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(session, "monotonic", lambda: 0.0)
    one = Session(1, SessionHub(car_plan(), Clock(), lambda order: None), Authenticator(), 10.0)
    one.introduce(encode(Hello(version=VERSION, proof=b"")))
    for now_s, count in ((0.0, 10), (0.25, 2), (9.0, 10)):
        monkeypatch.setattr(session, "monotonic", lambda now_s=now_s: now_s)
        for _ in range(count):
            one.receive(encode(Ping()))
        with pytest.raises(RobotRefused, match="Too many messages"):
            one.receive(encode(Ping()))


def test_a_client_keeps_the_newest_lease_and_events() -> None:
    client = Client(1)
    client.post(Lease(mine=True, holder="a"))
    client.post(Pong(token=1, now_ns=0))
    client.post(Lease(mine=False, holder="b"))
    for number in range(1_000):
        client.post(Event(name="bump", text="", at_ns=number))
    events = [Event(name="bump", text="", at_ns=number) for number in range(968, 1_000)]
    kept = [Pong(token=1, now_ns=0), Lease(mine=False, holder="b"), *events]
    assert list(iter(client.take, None)) == kept


def test_too_many_unread_answers_do_not_fit() -> None:
    client = Client(1)
    for number in range(256):
        client.post(Pong(token=number, now_ns=0))
    assert client.expelled == ""
    client.post(Pong(token=256, now_ns=0))
    assert client.expelled == "The client does not read its messages."
    client.post(Event(name="bump", text="", at_ns=0))
    assert len(list(iter(client.take, None))) == 257
