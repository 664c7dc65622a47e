"""A daemon in this process over real sockets, and a client that speaks bytes."""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import aiohttp
import pytest

from shapechanger.link.authentication import fingerprint_of, make_proof
from shapechanger.link.messages import (
    VERSION,
    Acknowledge,
    Arm,
    Challenge,
    ClientMessage,
    Command,
    Hello,
    Lease,
    Observation,
    Refused,
    RobotMessage,
    Take,
    Welcome,
    decode_robot_message,
    encode,
)
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon import process
from shapechanger.robot.daemon.camera import FrameReader
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.hardware import Clock, RealClock
from tests.robot.daemon.fakes import FakeCamera, FakeGuard
from tests.robot.daemon.plans import picture

_M = TypeVar("_M")
PATIENCE_S = 20.0


async def until(condition: Callable[[], object], what: str) -> None:
    """Wait until something holds, and say what did not."""
    try:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                await asyncio.sleep(0.002)
    except TimeoutError:
        raise AssertionError(f"Waited in vain until {what}.") from None


class Client:
    """One end of a connection, without any manners of its own."""

    def __init__(self, socket: aiohttp.ClientWebSocketResponse, certificate: bytes) -> None:
        self.socket = socket
        self.certificate = certificate
        self.heard: list[RobotMessage] = []

    async def say(self, message: ClientMessage) -> None:
        """Send a message."""
        await self.socket.send_bytes(encode(message))

    async def hear(self) -> RobotMessage | None:
        """The next message; None when the robot has closed."""
        async with asyncio.timeout(PATIENCE_S):
            message = await self.socket.receive()
        if message.type is not aiohttp.WSMsgType.BINARY:
            return None
        heard = decode_robot_message(message.data)
        self.heard.append(heard)
        return heard

    async def expect(self, kind: type[_M]) -> _M:
        """The next message of a kind, whatever comes before."""
        while (message := await self.hear()) is not None:
            if isinstance(message, kind):
                return message
        raise AssertionError(f"The robot closed without a {kind.__name__}: {self.heard}")

    async def closed_with(self) -> str:
        """Why the robot closes."""
        refused = await self.expect(Refused)
        while not refused.fatal:
            refused = await self.expect(Refused)
        assert await self.hear() is None
        return refused.reason

    async def greet(self, key: bytes = b"", **hello: Any) -> Welcome:
        """Say hello."""
        challenge = await self.expect(Challenge)
        role = hello.setdefault("role", "program")
        proof = make_proof(key, challenge.nonce, self.certificate, role)
        await self.say(Hello(**({"version": VERSION, "proof": proof} | hello)))
        return await self.expect(Welcome)

    async def take(self) -> Lease:
        """Ask for the command."""
        await self.say(Take())
        return await self.expect(Lease)

    async def obtain(self) -> None:
        """Ask for the command until it is had; what was told about another's comes first."""
        while not (await self.take()).mine:
            pass

    async def observe(self) -> Observation:
        """Ask for an observation."""
        await self.say(Acknowledge())
        return await self.expect(Observation)

    async def drive(self, seq: int, *values: float, answers: int | None = None) -> Observation:
        """Command in answer to a new observation."""
        seen = (await self.observe()).seq if answers is None else answers
        await self.say(Command(seq=seq, answers=seen, values=values or (0.0, 0.5)))
        return await self.expect(Observation)


@dataclass
class Running:
    """A daemon that serves."""

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
        """Let the camera take a new picture."""
        self.pictures += 1
        self.camera.put(Frame(picture(self.pictures), self.clock.now_ns()))

    @staticmethod
    def transport(client: Client) -> asyncio.Transport:
        """What a client's bytes go through, to treat it badly."""
        connection: Any = client.socket
        return connection._conn.transport

    @property
    def url(self) -> str:
        """Where the page is."""
        return f"{'https' if self.plan.certificate else 'http'}://127.0.0.1:{self.port}"

    @contextlib.asynccontextmanager
    async def connect(self, **settings: Any) -> AsyncIterator[Client]:
        """A connection that has said nothing yet."""
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        async with self.session.ws_connect(
            f"{self.url}/link", ssl=context, max_msg_size=0, **settings
        ) as socket:
            tls = socket.get_extra_info("ssl_object")
            certificate = fingerprint_of(tls.getpeercert(binary_form=True)) if tls else b""
            yield Client(socket, certificate)

    @contextlib.asynccontextmanager
    async def idle(self, stranger: socket.socket) -> AsyncIterator[None]:
        """A connection through the handshake that says nothing then."""
        context = ssl.create_default_context()
        context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        _, writer = await asyncio.open_connection(sock=stranger, ssl=context, server_hostname="x")
        yield
        writer.transport.abort()

    @contextlib.asynccontextmanager
    async def client(self, key: bytes = b"", **hello: Any) -> AsyncIterator[Client]:
        """A connection that is known."""
        async with self.connect() as client:
            await client.greet(key, **hello)
            yield client

    async def arm(self, client: Client, emergency: int = 0) -> None:
        """Let a client ask for arming, in answer to what it sees now."""
        seen = await client.observe()
        await client.say(Arm(answers=seen.seq, emergency=emergency))

    async def armed(self, client: Client) -> None:
        """Let a person take the command and arm."""
        await client.obtain()
        await self.arm(client)
        await until(lambda: self.guard.state.armed, "the guard is armed")


@contextlib.asynccontextmanager
async def running(
    plan: DaemonPlan, monkeypatch: pytest.MonkeyPatch, clock: Clock | None = None
) -> AsyncIterator[Running]:
    """A daemon with a fake guard and a fake camera."""
    clock = RealClock() if clock is None else clock
    camera = FakeCamera()
    reader = lambda *arguments: FrameReader(*arguments, opener=camera.open)  # noqa: E731
    monkeypatch.setattr(process, "FrameReader", reader)
    guard = FakeGuard(clock.now_ns)
    if plan.clock == "real":
        guard.attach()
    guard.say()
    ready, tell = os.pipe()
    daemon = process.Daemon(plan, clock, guard.daemon_fd, ready_fd=tell)
    task = asyncio.create_task(daemon.run())
    reading = asyncio.create_task(asyncio.to_thread(os.read, ready, 4096))
    await asyncio.wait((reading, task), return_when=asyncio.FIRST_COMPLETED)
    if not reading.done():  # The daemon could not begin.
        os.close(tell)
        await reading
        os.close(ready)
        guard.close()
        task.result()
    line = await reading
    os.close(ready)
    async with aiohttp.ClientSession() as session:
        port = json.loads(line)["port"]
        robot = Running(plan, clock, guard, camera, port, daemon, task, session)
        try:
            yield robot
        finally:
            daemon.end()
            async with asyncio.timeout(PATIENCE_S):
                await task
            guard.close()
