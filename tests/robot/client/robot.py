"""A fake robot: a real WebSocket over TLS on loopback, with a point on a line as its body."""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import simplejpeg
from aiohttp import WSMsgType, web

from shapechanger.layout import Element, Feature, Layout
from shapechanger.robot.client.known_robots import KnownRobot
from shapechanger.robot.daemon.credentials import Credentials, make_credentials
from shapechanger.robot.link import messages as m
from shapechanger.robot.link.authentication import is_proof, new_key, new_nonce, parse_key

FULL_SPEED = 2.0  # Speed at a throttle of 1, m/s.
WALL = 1.5  # Distance from the start to the wall, m.

STEERING = Feature("steering", "1", -1.0, 1.0, Element("actuator", "steering"))
THROTTLE = Feature("throttle", "1", -1.0, 1.0, Element("actuator", "throttle"))
STATE = (
    Feature("speed", "m/s", element=Element("sensor", "encoder")),
    Feature("collision", "1", 0.0, 1.0, Element("sensor", "bumper")),
    Feature("stall", "1", 0.0, 1.0, Element("sensor", "encoder")),
    Feature("battery", "V", 0.0, element=Element("sensor", "battery")),
)


def observation(**fields: Any) -> m.Observation:
    empty: dict[str, Any] = {
        name: 0 for name in m.Observation.__struct_fields__ if name.endswith(("seq", "_ns"))
    }
    empty |= dict.fromkeys(("state", "action_applied", "commanded", "suggested"), ())
    empty |= dict.fromkeys(("stop_reason", "holder", "holder_role", "suggested_by"), "")
    empty |= dict.fromkeys(("armed", "emergency", "mine"), False)
    empty |= dict.fromkeys(("applied_seq", "applied_ns", "command_ns", "frame"))
    return m.Observation(**{**empty, "sources": {}, "emergencies": 0, **fields})


def eventually(is_true: Callable[[], bool], within_s: float = 5.0) -> None:
    until = time.monotonic() + within_s
    while not is_true():
        assert time.monotonic() < until, "the condition did not hold in time"
        threading.Event().wait(0.001)


@dataclass
class Robot:
    """Settings and state of the robot, which tests change while it runs."""

    actions: tuple[Feature, ...] = (STEERING, THROTTLE)
    state: tuple[Feature, ...] = STATE
    image_size: tuple[int, int] | None = (160, 120)
    control_hz: float = 20.0
    arming: str = "anyone"
    reset: tuple[tuple[tuple[float, ...], float], ...] = ()
    reward: dict[str, float] = field(default_factory=dict)
    version: int = m.VERSION
    clock: str = "twin"
    silent: bool = False  # Sends no messages, on connections that stay open.
    frozen: bool = False  # The camera sends no new frame.
    delay_s: float = 0.0  # Delay of each answer.
    garbage: bytes | None = None  # Sent instead of the next observation.
    jpeg: bytes | None = None  # Sent as each frame; None for frames that encode their number.
    refusal: str = ""  # Reason for which each command is refused; "" to accept commands.
    held_by: str = ""  # Another client in control.
    absent: tuple[str, ...] = ()  # Features of the state without a measurement.
    arm_by_itself: bool = False  # Arms when a client takes control, and stays armed.
    home_at_take: bool = False  # Returns to its start when a client takes control.
    armed: bool = False
    emergency: bool = False
    stop_reason: str = ""
    messages: list[Any] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.key = new_key()
        self.port = 0
        self.connections = 0
        self._credentials: Credentials | None = None
        self._sockets: list[web.WebSocketResponse] = []
        self._now_ns = 10**9
        self._place = 0.0
        self._values = self._rest = (0.0,) * len(self.actions)
        self._seq = 0
        self._frame_seq = 0
        self._started = threading.Event()

    # Values that clients use.

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self.port}"

    @property
    def fingerprint(self) -> str:
        assert self._credentials is not None
        return self._credentials.fingerprint.hex()

    @property
    def known(self) -> KnownRobot:
        return KnownRobot("tin", self.address, self.key, self.fingerprint)

    @property
    def arguments(self) -> dict[str, Any]:
        return {"robot": self.address, "key": self.key, "fingerprint": self.fingerprint}

    def received(self, kind: type[Any]) -> list[Any]:
        return [message for message in self.messages if type(message) is kind]

    def stand_at(self, place: float) -> None:
        self._place = place

    # Serving.

    @contextlib.contextmanager
    def running(self, folder: Path, port: int = 0) -> Iterator[Robot]:
        self._credentials = make_credentials(folder, "tin")
        self._started.clear()
        thread = threading.Thread(target=lambda: asyncio.run(self._serve(port)))
        thread.start()
        assert self._started.wait(10.0)
        try:
            yield self
        finally:
            self._loop.call_soon_threadsafe(self._stop.set)
            thread.join()

    def cut(self) -> None:
        self._loop.call_soon_threadsafe(self._abort)

    def _abort(self) -> None:
        for socket in self._sockets:
            if socket._req is not None and socket._req.transport is not None:
                socket._req.transport.abort()

    def send(self, message: Any) -> None:
        async def broadcast() -> None:
            for socket in self._sockets:
                await socket.send_bytes(m.encode(message))

        asyncio.run_coroutine_threadsafe(broadcast(), self._loop).result(5.0)

    async def _serve(self, port: int) -> None:
        self._loop, self._stop = asyncio.get_running_loop(), asyncio.Event()
        app = web.Application()
        app.router.add_get("/link", self._talk)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=0.1)
        await runner.setup()
        assert self._credentials is not None
        await web.TCPSite(runner, "127.0.0.1", port, ssl_context=self._credentials.tls()).start()
        self.port = runner.addresses[0][1]
        self._started.set()
        await self._stop.wait()
        self._abort()
        await runner.cleanup()

    async def _talk(self, request: web.Request) -> web.WebSocketResponse:
        socket = web.WebSocketResponse(compress=False)
        await socket.prepare(request)
        assert self._credentials is not None
        nonce = new_nonce()
        await self._send(socket, m.Challenge(version=self.version, nonce=nonce, robot="tin"))
        raw = await socket.receive()
        if raw.type is not WSMsgType.BINARY:
            return socket
        hello = m.decode_client_message(raw.data)
        assert isinstance(hello, m.Hello)
        key, certificate = parse_key(self.key), self._credentials.fingerprint
        if not is_proof(hello.proof, key, nonce, certificate, hello.role):
            await self._send(socket, m.Refused(reason="Wrong key.", fatal=True))
            return socket
        self.connections += 1
        self._sockets.append(socket)
        await self._send(socket, self._welcome())
        with contextlib.suppress(ConnectionError):
            await self._converse(socket, hello)
        self._sockets.remove(socket)
        return socket

    async def _converse(self, socket: web.WebSocketResponse, hello: m.Hello) -> None:
        frame_sent, mine, sent_s = 0, False, 0.0
        async for raw in socket:
            if raw.type is not WSMsgType.BINARY:
                continue
            message = m.decode_client_message(raw.data)
            self.messages.append(message)
            if self.silent:
                continue
            if self.delay_s:
                await asyncio.sleep(self.delay_s)
            match message:
                case m.Ping():
                    await self._send(socket, m.Pong(token=0, now_ns=self._time_ns(hello)))
                case m.Take():
                    mine = not self.held_by
                    reason = "" if mine else f"{self.held_by} has control."
                    holder = hello.name if mine else self.held_by
                    await self._send(socket, m.Lease(mine=mine, holder=holder, reason=reason))
                    self.armed = self.armed or (mine and self.arm_by_itself)
                    if self.home_at_take:
                        self._place, self._frame_seq = 0.0, 0
                        self._values = self._rest
                case m.Release():
                    mine, self.armed = False, False
                case m.Disarm():
                    self.armed = self.arm_by_itself
                    self.messages.append("stood")
                case m.EmergencyStop():
                    self.emergency, self.stop_reason = True, message.reason
                case m.Arm():
                    if message.answers != self._seq:
                        await self._send(socket, m.Refused(reason="The observation is too old."))
                    elif self.arming == "person" and hello.role != "person":
                        await self._send(socket, m.Refused(reason="Only a person arms this robot."))
                    else:
                        self.armed, self.emergency = True, False
                case m.Command() | m.Acknowledge():
                    command = message if isinstance(message, m.Command) else None
                    if command is not None:
                        if self.refusal:
                            refused = m.Refused(reason=self.refusal, seq=command.seq)
                            await self._send(socket, refused)
                        moves = self.armed and not self.emergency and not self.refusal
                        self._values = command.values if moves else self._rest
                    if hello.pace == "realtime":
                        loop = asyncio.get_running_loop()
                        await asyncio.sleep(sent_s + 1.0 / self.control_hz - loop.time())
                        sent_s = max(loop.time(), sent_s + 1.0 / self.control_hz)
                    self._move(hello)
                    if self.garbage is not None:
                        await socket.send_bytes(self.garbage)
                        continue
                    seen = self._observe(hello, command, frame_sent, mine and not self.held_by)
                    frame_sent = seen.frame_seq
                    await self._send(socket, seen)

    def _time_ns(self, hello: m.Hello) -> int:
        return self._now_ns if hello.pace == "lockstep" else time.monotonic_ns()

    def _move(self, hello: m.Hello) -> None:
        self._now_ns += int(1e9 / self.control_hz)
        self._place = min(self._place + self._speed / self.control_hz, WALL)
        self._frame_seq += not self.frozen

    @property
    def _speed(self) -> float:
        names = [feature.name for feature in self.actions]
        return FULL_SPEED * dict(zip(names, self._values, strict=True)).get("throttle", 0.0)

    def _observe(
        self, hello: m.Hello, command: m.Command | None, frame_sent: int, mine: bool
    ) -> m.Observation:
        self._seq += 1
        now_ns = self._time_ns(hello)
        touches = self._place >= WALL
        quantities = {
            "speed": 0.0 if touches else self._speed,
            "collision": float(touches),
            "stall": float(touches and self._speed > 0.0),
            "battery": 7.4,
            **dict.fromkeys(self.absent, float("nan")),
        }
        frame = None
        if self.image_size is not None and hello.frames and frame_sent != self._frame_seq:
            frame = self.jpeg or picture(self.image_size, self._frame_seq)
        acts = command is not None and self.armed and not self.refusal
        return observation(
            seq=self._seq,
            captured_ns=now_ns - (10**15 if self.frozen else 0),
            state_ns=now_ns,
            sent_ns=now_ns,
            frame=frame,
            frame_seq=self._frame_seq if self.image_size else 0,
            state=tuple(quantities.get(f.name, 0.0) for f in self.state),
            sources={
                f.name: f.element.name
                for f in self.state
                if f.element and f.name not in self.absent
            },
            action_applied=self._values,
            **({"applied_seq": command.seq} if acts and command else {}),
            **dict.fromkeys(("applied_ns", "command_ns"), now_ns if acts else None),
            stop_reason=self.stop_reason,
            armed=self.armed,
            emergency=self.emergency,
            emergencies=int(self.emergency),
            holder=self.held_by or hello.name,
            mine=mine,
        )

    def _welcome(self) -> m.Welcome:
        return m.Welcome(
            robot="tin",
            body="car",
            action_layout=Layout(self.actions).to_json(),
            state_layout=Layout(self.state).to_json(),
            image_size=self.image_size,
            control_hz=self.control_hz,
            deadline_ms=250,
            max_observation_age_ms=400,
            reward=self.reward,
            reset=self.reset,
            arming=self.arming,  # type: ignore[arg-type]
            clock=self.clock,  # type: ignore[arg-type]
            session=self.connections,
        )

    async def _send(self, socket: web.WebSocketResponse, message: Any) -> None:
        await socket.send_bytes(m.encode(message))


def picture(size: tuple[int, int], number: int) -> bytes:
    """Return a JPEG that encodes a number: red is 8 times the number, modulo 256."""
    pixels = np.zeros((size[1], size[0], 3), np.uint8)
    pixels[..., 0] = 8 * number % 256
    pixels[..., 1] = np.linspace(0, 255, size[0], dtype=np.uint8)[None, :]
    return simplejpeg.encode_jpeg(pixels, quality=95, colorsubsampling="444")
