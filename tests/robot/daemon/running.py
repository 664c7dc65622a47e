"""A daemon in this process on real sockets, and a client that sends raw messages."""

import asyncio
import contextlib
import json
import ssl
import tempfile
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import aiohttp
import msgspec
import pytest

from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon import camera as daemon_camera
from shapechanger.robot.daemon import process
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link import messages as link
from shapechanger.robot.link.authentication import fingerprint_of, make_proof
from tests.robot.daemon.fakes import FakeCamera, FakeGuard
from tests.robot.daemon.plans import picture

_M = TypeVar("_M")
PATIENCE_S = 20.0


async def until(condition: Callable[[], object], what: str) -> None:
    """Wait for a condition; on timeout, the error contains `what`."""
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                await asyncio.sleep(0.002)
    except TimeoutError:
        raise AssertionError(f"Timed out waiting until {what}.") from None


class Client:
    """A client that sends only the messages of a test, valid or not."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse, certificate: bytes) -> None:
        self.socket = socket
        self.certificate = certificate
        self.received: list[link.RobotMessage] = []

    async def send(self, message: link.ClientMessage) -> None:
        await self.socket.send_bytes(link.encode(message))

    async def receive(self) -> link.RobotMessage | None:
        """Return the next message, or None after the robot has closed the connection."""
        async with asyncio.timeout(PATIENCE_S):
            message = await self.socket.receive()
        if message.type is not aiohttp.WSMsgType.BINARY:
            return None
        received = link.decode_robot_message(message.data)
        self.received.append(received)
        return received

    async def expect(self, kind: type[_M]) -> _M:
        while (message := await self.receive()) is not None:
            if isinstance(message, kind):
                return message
        raise AssertionError(f"The robot closed without a {kind.__name__}: {self.received}")

    async def closed_with(self) -> str:
        """Return the reason that the robot gives when it closes the connection."""
        refused = await self.expect(link.Refused)
        while not refused.fatal:
            refused = await self.expect(link.Refused)
        assert await self.receive() is None
        return refused.reason

    async def greet(self, key: bytes = b"", **hello: Any) -> link.Welcome:
        challenge = await self.expect(link.Challenge)
        role = hello.setdefault("role", "program")
        proof = make_proof(key, challenge.nonce, self.certificate, role)
        await self.send(link.Hello(**({"version": link.VERSION, "proof": proof} | hello)))
        return await self.expect(link.Welcome)

    async def take(self) -> link.Lease:
        await self.send(link.Take())
        return await self.expect(link.Lease)

    async def obtain(self) -> None:
        while not (await self.take()).mine:
            pass

    async def observe(self) -> link.Observation:
        await self.send(link.Acknowledge())
        return await self.expect(link.Observation)

    async def drive(self, seq: int, *values: float, answers: int | None = None) -> link.Observation:
        """Send a command that answers a new observation, and return the next observation."""
        seen = (await self.observe()).seq if answers is None else answers
        await self.send(link.Command(seq=seq, answers=seen, values=values or (0.0, 0.5)))
        return await self.expect(link.Observation)


@dataclass
class Running:
    """A daemon that serves, with its fake guard, camera and clock."""

    plan: DaemonPlan
    clock: Clock
    guard: FakeGuard
    camera: FakeCamera
    port: int
    daemon: process.Daemon
    task: asyncio.Task[str]
    session: aiohttp.ClientSession
    pictures: int = 0

    def show(self) -> None:
        self.pictures += 1
        self.camera.put(Frame(picture(self.pictures), self.clock.now_ns()))

    @staticmethod
    def transport(client: Client) -> asyncio.Transport:
        """Return the transport of a client, so that a test can break the connection."""
        connection: Any = client.socket
        return connection._conn.transport

    async def end(self) -> None:
        self.daemon.end()
        async with asyncio.timeout(PATIENCE_S):
            await self.task

    @property
    def url(self) -> str:
        return f"{'https' if self.plan.credentials else 'http'}://127.0.0.1:{self.port}"

    @contextlib.asynccontextmanager
    async def connect(self, **settings: Any) -> AsyncIterator[Client]:
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        async with self.session.ws_connect(
            f"{self.url}/link", ssl=context, max_msg_size=0, **settings
        ) as socket:
            tls = socket.get_extra_info("ssl_object")
            certificate = fingerprint_of(tls.getpeercert(binary_form=True)) if tls else b""
            yield Client(socket, certificate)

    @contextlib.asynccontextmanager
    async def client(self, key: bytes = b"", **hello: Any) -> AsyncIterator[Client]:
        async with self.connect() as client:
            await client.greet(key, **hello)
            yield client

    async def arm(self, client: Client, emergency: int = 0) -> None:
        seen = await client.observe()
        await client.send(link.Arm(answers=seen.seq, emergency=emergency))

    async def armed(self, client: Client) -> None:
        """Let a client take control and arm, and wait until the daemon reports it."""
        await client.obtain()
        await self.arm(client)
        await until(lambda: self.daemon._hub.state.armed, "the daemon's state is armed")


@contextlib.asynccontextmanager
async def running(
    plan: DaemonPlan, monkeypatch: pytest.MonkeyPatch, clock: Clock | None = None
) -> AsyncIterator[Running]:
    clock = Clock() if clock is None else clock
    camera = FakeCamera()
    monkeypatch.setattr(daemon_camera, "open_camera", camera.open)
    guard = FakeGuard(clock.now_ns)
    if plan.card.clock == "real":
        guard.attach()
    guard.send()
    async with contextlib.AsyncExitStack() as stack:
        stack.callback(guard.close)
        ready = Path(stack.enter_context(tempfile.TemporaryDirectory()), "ready.json")
        plan = msgspec.structs.replace(plan, ready_file=str(ready))
        daemon = process.Daemon(plan, clock, guard.daemon_fd)
        task = asyncio.create_task(daemon.run())
        await until(lambda: ready.exists() or task.done(), "it can be reached")
        if task.done():
            task.result()
        port = json.loads(ready.read_text())["port"]
        session = await stack.enter_async_context(aiohttp.ClientSession())
        robot = Running(plan, clock, guard, camera, port, daemon, task, session)
        stack.push_async_callback(robot.end)
        yield robot
