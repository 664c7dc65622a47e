"""The daemon on real sockets: authentication, control, limits and stops."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from functools import partial

import pytest

from shapechanger.robot.daemon import session
from shapechanger.robot.daemon.server import origin_refusal
from shapechanger.robot.link import messages as link
from tests.robot.daemon.running import Client, Running, until

pytestmark = pytest.mark.realtime


@pytest.mark.plan(secured=True)
async def test_a_wrong_key_is_refused_after_a_pause(
    robot: Running, key: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client with the right key can connect from the same address."""
    monkeypatch.setattr(session, "_WRONG_KEY_S", 0.05)
    loop = asyncio.get_running_loop()
    for _ in range(3):
        async with robot.connect() as client:
            began = loop.time()
            await client.send(link.Hello(version=link.VERSION, proof=b"w" * 32))
            assert "Wrong key" in await client.closed_with()
            assert loop.time() - began >= 0.05
    async with robot.connect() as client:
        assert client.socket.get_extra_info("ssl_object").version() == "TLSv1.3"
        welcome = await client.greet(key)
        assert (welcome.robot, welcome.session) == ("test car", 4)
        await client.observe()
    assert robot.guard.orders == []


async def _flood(send: Callable[[Client], Awaitable[None]], client: Client) -> None:
    for _ in range(1_000):
        await send(client)


@pytest.mark.parametrize(
    ("misbehave", "text"),
    [
        (lambda client: client.socket.send_bytes(b"\xc1\xff\x00"), "Not a valid message"),
        (
            lambda client: client.socket.send_bytes(bytes(link.MAX_CLIENT_MESSAGE + 1)),
            "than the 65536",
        ),
        (partial(_flood, lambda client: client.socket.ping(b"x")), "500 per second"),
        (partial(_flood, lambda client: client.socket.pong(b"x")), "500 per second"),
    ],
    ids=["garbage", "large", "pings", "pongs"],
)
async def test_an_invalid_message_ends_the_connection_and_stops_the_robot(
    robot: Running, misbehave: Callable[[Client], Awaitable[None]], text: str
) -> None:
    async with robot.client(role="person") as client:
        await robot.armed(client)
        await misbehave(client)
        assert text in await client.closed_with()
        await until(lambda: robot.guard.kinds()[-1:] == ["disarm"], "it is disarmed")
    async with robot.client() as other:
        assert (await other.observe()).armed is False


async def test_a_client_without_a_hello_is_disconnected(
    robot: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(session, "HELLO_TIMEOUT_S", 0.05)
    async with robot.connect() as client:
        assert "No hello was received" in await client.closed_with()


async def test_connections_are_limited_before_authentication(robot: Running) -> None:
    async with contextlib.AsyncExitStack() as stack:
        clients = [await stack.enter_async_context(robot.connect()) for _ in range(17)]
        await clients[0].expect(link.Challenge)
        assert await clients[0].receive() is None  # Displaced by the 17th connection.
        await clients[1].greet()


@pytest.mark.parametrize("how", ["release", "close", "abort"])
async def test_a_release_or_a_disconnection_disarms_the_robot(robot: Running, how: str) -> None:
    async with robot.client(role="person", name="Ann") as client:
        await robot.armed(client)
        if how == "release":
            await client.send(link.Release())
        elif how == "close":
            await client.socket.close()
        else:
            robot.transport(client).abort()
        await until(lambda: robot.guard.kinds() == ["arm", "disarm"], "it is disarmed")
    assert "Ann" in robot.guard.orders[-1].reason


async def test_an_emergency_stop_is_reported_to_all(robot: Running) -> None:
    """All clients get stops and refusals of the guard; a person who has seen a stop can end it."""
    async with robot.client(role="person") as ann, robot.client(name="sac") as sac:
        await robot.armed(ann)
        await sac.send(link.EmergencyStop(reason="a cat"))
        while (event := await ann.expect(link.Event)).name != "emergency":
            pass
        assert event.text == "Emergency stop: sac: a cat"
        seen = await ann.observe()
        assert (seen.emergency, seen.emergencies, seen.armed) == (True, 1, False)
        await ann.send(link.Command(seq=1, answers=seen.seq, values=(0.0, 0.5)))
        refused = await ann.expect(link.Refused)
        assert ("Emergency stop" in refused.reason, refused.seq) == (True, 1)
        await robot.arm(ann, emergency=1)
        await until(lambda: robot.guard.state.armed, "it is armed again")


@pytest.mark.plan(control_hz=200.0)
async def test_a_client_that_does_not_read_is_dropped(
    robot: Running, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The client's unread messages do not delay other clients."""
    patience_s = 3.0
    monkeypatch.setattr(session, "_SEND_S", patience_s)
    loop, worst = asyncio.get_running_loop(), 0.0
    async with robot.client(role="person") as slow, robot.client() as client:
        await slow.obtain()
        robot.transport(slow).pause_reading()

        async def keep_asking() -> None:
            while True:
                robot.show()
                await slow.send(link.Acknowledge())
                await asyncio.sleep(0.004)

        asking = asyncio.create_task(keep_asking())
        while robot.guard.kinds()[-1:] != ["disarm"]:
            began = loop.time()
            await client.observe()
            worst = max(worst, loop.time() - began)
        asking.cancel()
        await asyncio.gather(asking, return_exceptions=True)
        assert worst < patience_s
        robot.transport(slow).abort()


@pytest.mark.plan(robot="<b>car")
async def test_pages_have_safe_headers_and_not_the_robots_name(robot: Running) -> None:
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
    async with robot.session.get(f"{robot.url}/healthz") as health:
        assert (health.status, await health.json()) == (200, {"guard": "well"})
    for path in ("/nothing", "/../etc/passwd"):
        async with robot.session.get(robot.url + path) as missing:
            assert missing.status == 404
            assert missing.headers["X-Content-Type-Options"] == "nosniff"


@pytest.mark.parametrize(
    ("origin", "host", "is_open", "allowed"),
    [
        (None, "anything", True, True),
        ("https://CAR.local:5000", "car.local:5000", False, True),
        ("https://evil.example", "car.local:5000", False, False),
        ("null", "car.local:5000", False, False),
        ("http://evil.example:5000", "evil.example:5000", False, True),
        ("http://evil.example:5000", "evil.example:5000", True, False),
        ("http://[::1]:5000", "[::1]:5000", True, True),
        ("http://localhost:5000", "localhost:5000", True, True),
        ("http://a b", "a b", True, False),
    ],
)
def test_only_the_robots_own_page_may_connect(
    origin: str | None, host: str, is_open: bool, allowed: bool
) -> None:
    assert (origin_refusal(origin, host, is_open=is_open) == "") == allowed
