"""The daemon on real sockets: authentication, control, limits and stops."""

import asyncio
from collections.abc import Awaitable, Callable
from functools import partial

import pytest

from shapechanger.errors import RobotError
from shapechanger.robot.daemon import session
from shapechanger.robot.daemon.server import origin_refusal
from shapechanger.robot.link.messages import (
    MAX_CLIENT_MESSAGE,
    VERSION,
    Acknowledge,
    Challenge,
    Command,
    EmergencyStop,
    Event,
    Hello,
    Lease,
    Refused,
    Release,
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
    """A client with the right key is not kept out."""
    monkeypatch.setattr(session, "_WRONG_KEY_S", 0.05)
    loop = asyncio.get_running_loop()
    for _ in range(3):
        async with robot.connect() as client:
            began = loop.time()
            await client.send(Hello(version=VERSION, proof=b"w" * 32))
            assert "Wrong key" in await client.closed_with()
            assert loop.time() - began >= 0.05
    async with robot.client(key, role="person") as client:
        await client.observe()
    assert robot.guard.orders == []


async def _flood(send: Callable[[Client], Awaitable[None]], client: Client) -> None:
    for _ in range(1_000):
        await send(client)


@pytest.mark.parametrize(
    ("misbehave", "text"),
    [
        (lambda client: client.socket.send_bytes(b"\xc1\xff\x00"), "Not a valid message"),
        (lambda client: client.socket.send_bytes(bytes(MAX_CLIENT_MESSAGE + 1)), "than the 65536"),
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


async def test_an_invalid_command_ends_the_command_before_it(robot: Running) -> None:
    async with robot.client(role="person") as client:
        await robot.armed(client)
        seen = await client.drive(1, 0.0, 0.5)
        await client.send(Command(seq=2, answers=seen.seq, values=(0.0, float("nan"))))
        refused = await client.expect(Refused)
        assert (refused.seq, refused.fatal) == (2, False)
        await until(lambda: robot.guard.kinds()[-1] == "halt", "it is halted")
        assert (robot.guard.state.armed, robot.guard.state.applied) == (True, (0.0, 0.0))
        assert (await client.drive(3, 0.0, 0.25)).action_applied == (0.0, 0.25)


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


async def test_a_refusal_of_the_guard_is_passed_on(robot: Running) -> None:
    async with robot.client() as client:
        await client.take()
        seen = await client.observe()
        await client.send(Command(seq=3, answers=seen.seq, values=(0.0, 1.0)))
        assert await client.expect(Refused) == Refused(reason="Not armed.", seq=3)


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
