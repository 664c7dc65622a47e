"""The daemon on real sockets: authentication, control, limits and stops."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import ssl
from collections.abc import Awaitable, Callable
from functools import partial

import aiohttp
import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.daemon import server, session
from shapechanger.robot.daemon.server import Listener, origin_refusal
from shapechanger.robot.link.authentication import make_proof
from shapechanger.robot.link.messages import (
    MAX_CLIENT_MESSAGE,
    VERSION,
    Acknowledge,
    Arm,
    Challenge,
    Command,
    Disarm,
    EmergencyStop,
    Event,
    Hello,
    Lease,
    Observation,
    Ping,
    Pong,
    Refused,
    Release,
    encode,
)
from tests.robot.daemon.plans import car_plan
from tests.robot.daemon.running import Client, Running, running, until

pytestmark = pytest.mark.realtime


@pytest.mark.plan(secured=True)
async def test_a_client_with_the_key_is_welcomed(robot: Running, key: bytes) -> None:
    async with robot.connect() as client:
        tls = client.socket.get_extra_info("ssl_object")
        assert tls.version() == "TLSv1.3"
        welcome = await client.greet(key)
        assert (welcome.robot, welcome.body, welcome.session) == ("test car", "car", 1)
        assert welcome.image_size == (160, 120)


@pytest.mark.plan(secured=True)
async def test_a_wrong_key_is_refused_slowly(
    robot: Running, key: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "_WRONG_KEY_S", 0.05)
    loop = asyncio.get_running_loop()
    for _ in range(8):
        async with robot.connect() as client:
            began = loop.time()
            with pytest.raises(AssertionError):
                await client.greet(b"wrong" * 4)
            assert loop.time() - began >= 0.05
            refused = client.received[-1]
            assert isinstance(refused, Refused)
            assert refused.fatal
            assert "Wrong key" in refused.reason
    async with robot.client(key, role="person") as client:
        await client.observe()
    assert robot.guard.orders == []


@pytest.mark.parametrize("spoiled", ["nonce", "certificate", "role"])
@pytest.mark.plan(secured=True)
async def test_a_proof_for_another_challenge_is_refused(
    robot: Running, key: bytes, monkeypatch: pytest.MonkeyPatch, spoiled: str
) -> None:
    monkeypatch.setattr(session, "_WRONG_KEY_S", 0.0)
    async with robot.connect() as client:
        challenge = await client.expect(Challenge)
        nonce = b"n" * 32 if spoiled == "nonce" else challenge.nonce
        certificate = b"c" * 32 if spoiled == "certificate" else client.certificate
        role = "person" if spoiled == "role" else "program"
        proof = make_proof(key, nonce, certificate, role)
        await client.send(Hello(version=VERSION, proof=proof))
        assert "Wrong key" in await client.closed_with()


async def test_another_version_is_refused_with_both_numbers(robot: Running) -> None:
    async with robot.connect() as client:
        await client.send(Hello(version=VERSION + 1, proof=b""))
        reason = await client.closed_with()
        assert f"version {VERSION} " in reason
        assert f"client {VERSION + 1}" in reason


async def _text(client: Client) -> None:
    await client.socket.send_str("hello")


async def _garbage(client: Client) -> None:
    await client.socket.send_bytes(b"\xc1\xff\x00")


async def _cut(client: Client) -> None:
    await client.socket.send_bytes(encode(Command(seq=1, answers=1, values=(0.0, 1.0)))[:-3])


async def _large(client: Client) -> None:
    await client.socket.send_bytes(bytes(MAX_CLIENT_MESSAGE + 1))


async def _hello_again(client: Client) -> None:
    await client.send(Hello(version=VERSION, proof=b""))


async def _flood(client: Client) -> None:
    for token in range(1_000):
        await client.send(Ping(token=token))


async def _ping_flood(client: Client) -> None:
    for _ in range(1_000):
        await client.socket.ping(b"x")


async def _pong_flood(client: Client) -> None:
    for _ in range(1_000):
        await client.socket.pong(b"x")


@pytest.mark.parametrize(
    ("misbehave", "words"),
    [
        (_text, "binary messages"),
        (_garbage, "Not a valid message"),
        (_cut, "Not a valid message"),
        (_large, "larger than the 65536 allowed"),
        (_hello_again, "sent already"),
        (_flood, "500 per second"),
        (_ping_flood, "500 per second"),
        (_pong_flood, "500 per second"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
async def test_an_invalid_message_ends_the_connection_and_stops_the_robot(
    robot: Running, misbehave: Callable[[Client], Awaitable[None]], words: str
) -> None:
    async with robot.client(role="person") as client:
        await robot.armed(client)
        await misbehave(client)
        assert words in await client.closed_with()
        await until(lambda: robot.guard.kinds()[-1:] == ["disarm"], "it is disarmed")
    async with robot.client() as other:
        assert (await other.observe()).armed is False


async def test_a_huge_message_ends_the_connection_early(robot: Running) -> None:
    async with robot.client() as client:
        with contextlib.suppress(ConnectionError, aiohttp.ClientError):
            await client.socket.send_bytes(bytes(100 * 10**6))
        while await client.receive() is not None:
            pass
        assert client.socket.close_code in (1006, 1009)


async def test_a_client_without_a_hello_is_disconnected(
    robot: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "HELLO_TIMEOUT_S", 0.05)
    async with robot.connect() as client:
        assert "No hello was received" in await client.closed_with()


async def test_connections_are_limited_before_and_after_authentication(robot: Running) -> None:
    """16 per address before authentication; 6 programs and 8 clients in total after it.

    A ninth person takes the place of the oldest client, or of the next if that one has control.
    """
    strangers = [robot.connect() for _ in range(17)]
    clients = [await stranger.__aenter__() for stranger in strangers]
    await clients[0].expect(Challenge)
    assert await clients.pop(0).receive() is None  # Displaced by the 17th connection.
    for client in clients[:6]:
        await client.greet(role="program")
    await clients[6].send(Hello(version=VERSION, proof=b"", role="program"))
    assert "only a person can still connect" in await clients[6].closed_with()
    await clients[7].greet(role="person")
    await clients[0].obtain()
    async with robot.client(role="person"), robot.client(role="person", name="ninth") as ninth:
        assert await clients[1].closed_with() == ("ninth connected, and 8 clients are the limit.")
        await ninth.send(EmergencyStop(reason="a dog"))
        await until(lambda: robot.guard.state.emergency, "it has stopped")
        assert (await clients[0].observe()).mine
        await clients[8].greet(role="person", name="tenth")
        assert "tenth connected" in await clients[2].closed_with()
        await clients[9].send(Hello(version=VERSION, proof=b"", role="program"))
        assert "8 clients are connected" in await clients[9].closed_with()
    for stranger in strangers:
        await stranger.__aexit__(None, None, None)


async def test_a_second_program_waits_and_a_person_does_not(robot: Running) -> None:
    async with (
        robot.client(name="sac") as sac,
        robot.client(name="ppo") as ppo,
        robot.client(name="Ann", role="person") as ann,
    ):
        assert await sac.take() == Lease(mine=True, holder="sac", reason="sac has control.")
        lease = await ppo.take()
        assert (lease.mine, lease.holder) == (False, "sac")
        await robot.armed(ann)
        lost = await sac.expect(Lease)
        assert (lost.mine, lost.holder) == (False, "Ann")
        assert "took control from sac" in lost.reason
        assert "halt" in robot.guard.kinds()  # The last command of sac is no longer in force.
        await sac.send(Command(seq=1, answers=0, values=(0.0, 1.0)))
        assert "do not have control" in (await sac.expect(Refused)).reason
        assert (await ann.drive(1, 0.0, 0.5)).action_applied == (0.0, 0.5)
    commands = [order for order in robot.guard.orders if order.kind == "command"]
    assert [(order.session, order.values) for order in commands] == [(2, (0.0, 0.5))]


async def test_invalid_commands_do_not_reach_the_guard(robot: Running) -> None:
    async with robot.client(role="person") as client:
        await robot.armed(client)
        seen = await client.drive(5, 0.0, 0.25)
        nan = float("nan")
        for seq, answers, values, words in (
            (5, seen.seq, (0.0, 1.0), "not newer than 5"),
            (4, seen.seq, (0.0, 1.0), "not newer than 5"),
            (6, seen.seq + 100, (0.0, 1.0), "not sent to this client"),
            (7, seen.seq, (1.0,), "has 2 values, got 1"),
            (8, seen.seq, (0.0, nan), "must be finite"),
        ):
            await client.send(Command(seq=seq, answers=answers, values=values))
            refused = await client.expect(Refused)
            assert (refused.seq, refused.fatal) == (seq, False)
            assert words in refused.reason
        assert robot.guard.kinds() == ["arm", "command", "halt", "halt"]


async def test_an_invalid_command_ends_the_command_before_it(robot: Running) -> None:
    async with robot.client(role="person") as client:
        await robot.armed(client)
        seen = await client.drive(1, 0.0, 0.5)
        await client.send(Command(seq=2, answers=seen.seq, values=(0.0, float("nan"))))
        await until(lambda: robot.guard.kinds()[-1] == "halt", "it is halted")
        assert robot.guard.state.armed
        assert robot.guard.state.applied == (0.0, 0.0)
        assert (await client.drive(3, 0.0, 0.25)).action_applied == (0.0, 0.25)


@pytest.mark.plan(max_observation_age_ms=20)
async def test_a_late_request_to_arm_or_move_is_refused(robot: Running) -> None:
    async with robot.client(role="person") as client:
        await client.take()
        seen = await client.observe()
        await asyncio.sleep(0.03)  # This is the age itself, and no wait for something.
        await client.send(Arm(answers=seen.seq))
        assert "at most 20 ms are allowed" in (await client.expect(Refused)).reason
        await client.send(Command(seq=1, answers=seen.seq, values=(0.0, 1.0)))
        assert "at most 20 ms are allowed" in (await client.expect(Refused)).reason
        await client.send(Arm(answers=seen.seq + 2))
        reason = (await client.expect(Refused)).reason
        assert reason.startswith("Not armed. ")
        assert "not sent to this client" in reason
        assert robot.guard.orders == []


@pytest.mark.parametrize("what", ["says nothing", "half a handshake", "idles", "no hello"])
@pytest.mark.plan(secured=True)
async def test_a_hundred_silent_connections_keep_no_client_out(
    robot: Running, key: bytes, what: str
) -> None:
    async with contextlib.AsyncExitStack() as stack:
        await robot.armed(await stack.enter_async_context(robot.client(key, role="person")))
        for _ in range(100 if what != "no hello" else 12):
            if what == "no hello":
                await stack.enter_async_context(robot.connect())
                continue
            stranger = socket.socket()
            stack.callback(stranger.close)
            stranger.setblocking(False)
            address = ("127.0.0.1", robot.port)
            await asyncio.get_running_loop().sock_connect(stranger, address)
            if what == "half a handshake":
                stranger.sendall(b"\x16\x03\x01\x02\x00\x01")
            if what == "idles":
                await stack.enter_async_context(robot.idle(stranger))
        async with robot.client(key, role="person") as client:
            await client.send(EmergencyStop(reason="a child"))
            await until(lambda: robot.guard.state.emergency, "it has stopped")


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let connections wait for their first request for a short time only."""
    monkeypatch.setattr(server, "Listener", partial(Listener, timeout_s=0.2))


@pytest.mark.parametrize(
    "secure", [pytest.param(on, marks=pytest.mark.plan(secured=on)) for on in (True, False)]
)
async def test_a_connection_without_a_request_is_dropped(
    impatient: None, robot: Running, key: bytes, secure: bool
) -> None:
    async with robot.client(key) as client:
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        for tls in {None, context if secure else None}:
            for request in (b"", b"GET / HTTP/1.1\r\n", b"GET / HTTP/1.1\r\nHost: x\r\n\r\n"):
                if tls is None and secure and request:
                    continue
                ends = await asyncio.open_connection("127.0.0.1", robot.port, ssl=tls)
                ends[1].write(request)
                async with asyncio.timeout(20.0):
                    received = await ends[0].read()
                assert received.startswith(b"HTTP/1.1 200 OK" if b"Host" in request else b"")
                ends[1].close()
        await client.observe()


async def test_the_scale_multiplies_the_values(robot: Running) -> None:
    async with robot.client(role="person") as client:
        await robot.armed(client)
        robot.show()
        seen = await client.observe()
        while seen.frame is None:
            seen = await client.observe()
        await client.send(
            Command(seq=1, answers=seen.seq, values=(-1.0, 0.5), scale=0.5, ttl_ms=80)
        )
        await client.expect(Observation)
        order = robot.guard.orders[-1]
        assert (order.values, order.ttl_ms) == ((-0.5, 0.25), 80)
        assert order.frame_ns == seen.captured_ns


@pytest.mark.parametrize("how", ["release", "close", "abort"])
async def test_leaving_disarms_the_robot(robot: Running, how: str) -> None:
    async with robot.client(role="person", name="Ann") as client:
        await robot.armed(client)
        if how == "release":
            await client.send(Release())
        elif how == "close":
            await client.socket.close()
        else:
            robot.transport(client).abort()
        await until(lambda: robot.guard.kinds() == ["arm", "disarm"], "it is disarmed")
    assert "Ann" in robot.guard.orders[-1].reason


async def test_any_client_can_stop_the_robot_and_only_a_person_can_rearm(robot: Running) -> None:
    async with (
        robot.client(role="person", name="Ann") as ann,
        robot.client(name="sac") as sac,
    ):
        await robot.armed(ann)
        await sac.send(EmergencyStop(reason="a\x1b[2Jcat"))
        event = await ann.expect(Event)
        while event.name != "emergency":
            event = await ann.expect(Event)
        assert robot.guard.orders[-1].reason == "sac: a [2Jcat"
        seen = await ann.observe()
        assert (seen.emergency, seen.emergencies, seen.armed) == (True, 1, False)
        await robot.arm(sac, emergency=1)
        assert "person" in (await sac.expect(Refused)).reason
        await robot.arm(ann, emergency=1)
        await until(lambda: robot.guard.state.armed, "it is armed again")
        order = robot.guard.orders[-1]
        assert (order.emergency, order.person) == (1, True)


@pytest.mark.parametrize(
    "arming",
    [pytest.param(who, marks=pytest.mark.plan(arming=who)) for who in ("person", "anyone")],
)
async def test_clients_that_may_arm(robot: Running, arming: str) -> None:
    async with robot.client() as one, robot.client() as two:
        await robot.arm(one)
        assert "No client has control" in (await one.expect(Refused)).reason
        await one.take()
        await robot.arm(two)
        await two.expect(Refused)
        await two.send(Disarm())
        assert "emergency stop" in (await two.expect(Refused)).reason
        await robot.arm(one)
        if arming == "person":
            assert "Only a person" in (await one.expect(Refused)).reason
            assert robot.guard.orders == []
            return
        await until(lambda: robot.guard.state.armed, "it is armed")
        assert robot.guard.orders[-1].person is False
        await one.send(EmergencyStop())
        await until(lambda: robot.guard.state.emergency, "it is stopped")
        while not (await one.observe()).emergency:
            pass
        await robot.arm(one, emergency=1)
        assert "Only a person can end" in (await one.expect(Refused)).reason


async def test_a_refusal_of_the_guard_is_passed_on(robot: Running) -> None:
    async with robot.client() as client:
        await client.take()
        seen = await client.observe()
        await client.send(Command(seq=3, answers=seen.seq, values=(0.0, 1.0)))
        assert await client.expect(Refused) == Refused(reason="Not armed.", seq=3)


async def test_a_ping_is_answered_with_the_time(robot: Running) -> None:
    async with robot.client() as client:
        before = robot.clock.now_ns()
        await client.send(Ping(token=77))
        pong = await client.expect(Pong)
        assert pong.token == 77
        assert before <= pong.now_ns <= robot.clock.now_ns()


@pytest.mark.plan(control_hz=200.0)
async def test_a_client_that_does_not_read_is_dropped(
    robot: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    patience_s = 3.0
    monkeypatch.setattr(session, "_SEND_S", patience_s)
    connecting = robot.connect()
    slow = await connecting.__aenter__()
    await slow.greet(role="person")
    await slow.obtain()
    robot.transport(slow).pause_reading()
    async with robot.client() as client:

        async def keep_asking() -> None:
            while True:
                robot.show()
                await slow.send(Acknowledge())
                await asyncio.sleep(0.004)

        pinging = asyncio.create_task(keep_asking())
        loop, worst = asyncio.get_running_loop(), 0.0
        while robot.guard.kinds()[-1:] != ["disarm"]:
            began = loop.time()
            await client.observe()
            worst = max(worst, loop.time() - began)
        pinging.cancel()
        await asyncio.gather(pinging, return_exceptions=True)
        assert worst < patience_s  # The other client was not delayed.
        await client.obtain()
    robot.transport(slow).abort()
    await connecting.__aexit__(None, None, None)


@pytest.mark.plan(robot="<b>car")
async def test_the_console_reveals_only_the_robots_name(robot: Running) -> None:
    async with robot.session.get(robot.url) as page:
        assert page.content_type == "text/html"
        assert "<b>car" not in await page.text()
        policy = page.headers["Content-Security-Policy"]
        assert "default-src 'none'" in policy
        assert "unsafe" not in policy
        assert page.headers["X-Frame-Options"] == "DENY"
        assert "aiohttp" not in page.headers["Server"]
    async with robot.session.get(f"{robot.url}/console/main.js") as page:
        assert page.content_type == "text/javascript"
    async with robot.session.get(f"{robot.url}/console/robot.json") as known:
        assert (await known.json())["robot"] == "<b>car"
    async with robot.session.get(f"{robot.url}/healthz") as health:
        assert (health.status, await health.json()) == (200, {"guard": "well"})
    for path in ("/nothing", "/../etc/passwd"):
        async with robot.session.get(robot.url + path) as missing:
            assert missing.status == 404
            assert missing.headers["X-Content-Type-Options"] == "nosniff"


async def test_a_page_of_another_server_cannot_drive(robot: Running) -> None:
    with pytest.raises(aiohttp.WSServerHandshakeError, match="403"):
        async with robot.connect(origin="http://evil.example"):
            pass
    async with robot.connect(origin=robot.url) as client:
        await client.greet()


async def test_a_port_in_use_is_an_error(robot: Running, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(RobotError, match="served already"):
        async with running(car_plan(port=robot.port), monkeypatch):
            pass


@pytest.mark.parametrize(
    ("origin", "host", "is_open", "allowed"),
    [
        (None, "anything", True, True),
        ("https://car.local:5000", "car.local:5000", False, True),
        ("https://CAR.local:5000", "car.local:5000", False, True),
        ("https://evil.example", "car.local:5000", False, False),
        ("null", "car.local:5000", False, False),
        ("http://evil.example:5000", "evil.example:5000", False, True),
        ("http://evil.example:5000", "evil.example:5000", True, False),
        ("http://127.0.0.1:5000", "127.0.0.1:5000", True, True),
        ("http://[::1]:5000", "[::1]:5000", True, True),
        ("http://localhost:5000", "localhost:5000", True, True),
        ("http://a b", "a b", True, False),
    ],
)
def test_only_the_robots_own_page_may_connect(
    origin: str | None, host: str, is_open: bool, allowed: bool
) -> None:
    assert (origin_refusal(origin, host, is_open=is_open) == "") == allowed
