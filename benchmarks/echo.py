"""Daemon with a simulated guard and camera of negligible cost, to measure the link alone.

A new image is always available, so each command is answered at once with an observation that
has an image, as on a robot whose camera is faster than its client.
"""

from __future__ import annotations

import contextlib
import io
import os
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Self

import msgspec
import numpy as np
import simplejpeg
from numpy.typing import NDArray

from shapechanger.contract.plan import ActionPlan, GuardPlan
from shapechanger.layout import Feature, Layout
from shapechanger.robot.cameras.camera import CameraPlan
from shapechanger.robot.cameras.jpeg import with_capture_time
from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.client.known_robots import KnownRobot
from shapechanger.robot.daemon.credentials import make_credentials
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard import channel as wire
from shapechanger.robot.guard.running import ServePlan, plan_fd
from shapechanger.robot.link.card import RobotCard

_HZ = 100.0
# A robot accepts 500 messages per second and closes the connection of a client that sends more.
_PAUSE_S = 0.0025
_PICTURE_S = 0.002
_DESCRIPTOR = socket.CMSG_SPACE(4)  # An ancillary message with one descriptor.


class EchoRobot:
    """Robot whose daemon is one process and whose guard and camera are another."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory()
        folder = Path(self._folder.name)
        os.mkfifo(folder / "camera.mjpeg")
        ours, daemons = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        credentials = make_credentials(folder / "credentials", "echo")
        actions = Layout((Feature("steering", "1", -1, 1), Feature("throttle", "1", -1, 1)))
        daemon = DaemonPlan(
            card=RobotCard(
                robot="echo",
                body="car",
                action_layout=actions.to_json(),
                state_layout=Layout((Feature("speed", "m/s"),)).to_json(),
                image_size=(160, 120),
                control_hz=_HZ,
                deadline_ms=250,
                max_observation_age_ms=400,
                reward={},
                reset=(),
                arming="anyone",
                clock="real",
            ),
            camera=CameraPlan("pipe", fps=_HZ, settings={"path": str(folder / "camera.mjpeg")}),
            port=0,
            credentials=str(credentials.folder),
            discovery=False,
            ready_file=str(folder / "ready.json"),
        )
        guard = GuardPlan("echo", (ActionPlan("steering"), ActionPlan("throttle")), ())
        plan = plan_fd(ServePlan(guard, msgspec.to_builtins(daemon)))
        with ours, daemons:
            self._echo = subprocess.Popen(
                [sys.executable, "-m", __name__, str(ours.fileno()), str(folder / "camera.mjpeg")],
                pass_fds=(ours.fileno(),),
            )
            command = [sys.executable, "-m", "shapechanger.robot.daemon.process"]
            command += ["--plan-fd", str(plan), "--guard-fd", str(daemons.fileno())]
            self._daemon = subprocess.Popen(
                command, pass_fds=(plan, daemons.fileno()), stderr=subprocess.DEVNULL
            )
        os.close(plan)
        ready = folder / "ready.json"
        while not ready.exists():
            time.sleep(0.01)
        port = int(ready.read_text().split('"port": ')[1].split(",")[0])
        address, fingerprint = f"127.0.0.1:{port}", credentials.fingerprint.hex()
        self._known = KnownRobot("echo", address, credentials.key, fingerprint)

    def __enter__(self) -> Self:
        """Return the robot."""
        return self

    def __exit__(self, *_: object) -> None:
        """End both processes."""
        for process in (self._daemon, self._echo):
            process.kill()
            process.wait()
        self._folder.cleanup()

    def round_trips(self, count: int) -> NDArray[np.float64]:
        """Return the seconds from sending a command to receiving the image that answers it."""
        times: list[float] = []
        with RobotClient.connect(self._known) as client:
            client.take()
            client.arm()
            seen = client.ask()
            while len(times) < count:
                began = time.perf_counter()
                seen = client.exchange((0.0, 0.5), seen)
                if seen.message.frame is not None:
                    times.append(time.perf_counter() - began)
                time.sleep(_PAUSE_S)
        return np.asarray(times)


def main(guard_fd: int, fifo: Path) -> None:
    """Run guard and camera: a state and an image every 2 ms and after each order."""
    rng = np.random.default_rng(0)
    small = rng.integers(0, 256, (15, 20, 3), dtype=np.uint8)
    pictures = [
        simplejpeg.encode_jpeg(
            np.ascontiguousarray(np.roll(small, n, 1).repeat(8, 0).repeat(8, 1)), quality=80
        )
        for n in range(20)
    ]
    with socket.socket(fileno=guard_fd) as daemon, io.FileIO(fifo, "w") as camera:
        daemon.settimeout(_PICTURE_S)
        n = 0
        order = wire.Order("disarm")
        while True:
            with contextlib.suppress(TimeoutError):
                data, descriptors, _, _ = daemon.recvmsg(wire.MAX_DATAGRAM, _DESCRIPTOR)
                if not data:
                    return
                if descriptors:  # The daemon's lifeline, which needs no answer.
                    continue
                order = wire.decode_order(data)
            now_ns = time.monotonic_ns()
            state = wire.GuardState(
                at_ns=now_ns,
                armed=True,
                emergency=False,
                emergencies=0,
                stop_reason="",
                applied=order.values or (0.0, 0.0),
                applied_session=order.session,
                applied_seq=order.seq,
                applied_ns=now_ns,
                refused="",
                refused_seq=None,
                outputs={},
                quantities={"speed": 0.5},
                sources={"speed": "wheel"},
                bumps=0,
            )
            daemon.send(wire.encode(state))
            n += 1
            camera.write(with_capture_time(pictures[n % len(pictures)], now_ns))


if __name__ == "__main__":
    main(int(sys.argv[1]), Path(sys.argv[2]))
