"""The console in a browser, and the outputs of its robot."""

from __future__ import annotations

import contextlib
import json
import math
from typing import Any, Final, Self

import msgspec
from playwright.sync_api import Browser, Page, TimeoutError

from shapechanger.robot.profile.load import load_profile
from shapechanger.robot.twin.judge import propelled
from shapechanger.robot.twin.robot import RunningRobot
from shapechanger.robot.twin.signals import Transition, apply
from shapechanger.robot.twin.wiring import TwinWiring
from tests.robot.twin.robots import until

DESK: Final[dict[str, Any]] = {"viewport": {"width": 1280, "height": 800}}
PHONE: Final[dict[str, Any]] = {
    "viewport": {"width": 390, "height": 844},
    "has_touch": True,
    "is_mobile": True,
}
PHONE_ON_ITS_SIDE: Final[dict[str, Any]] = PHONE | {"viewport": {"width": 844, "height": 390}}

# Bytes of a ledger: some minutes of a robot.
_RECENT: Final = 1_000_000

_PRESSES: Final = 6
_PRESSED_S: Final = 10.0
# Errors that Chromium logs for failures that a test provokes.
_PROVOKED: Final = ("net::ERR_", "WebSocket connection to")


class Console:
    """A page of the console in its own browser context.

    Args:
        browser: The browser.
        robot: The robot that serves the page.
        key: Key in the address; None for that of the robot, "" for none.
        script: Script to run before those of the page.
        address: Address of the page; "" for that of the robot.
        options: Options of the browser's context, such as `PHONE`.

    Attributes:
        page: The page.
        errors: Errors of its scripts and of the browser, such as policy violations.
        requested: The addresses that it requested.
        sent: The messages that it sent to the robot.
    """

    def __init__(
        self,
        browser: Browser,
        robot: RunningRobot,
        *,
        key: str | None = None,
        script: str = "",
        address: str = "",
        **options: Any,
    ) -> None:
        self._context = browser.new_context(ignore_https_errors=True, **(DESK | options))
        self._context.set_default_timeout(60_000)
        self.page: Page = self._context.new_page()
        self.errors: list[str] = []
        self.requested: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda message: self._on_console(message.type, message.text))
        self.sent: list[dict[str, Any]] = []
        self.page.on("websocket", lambda socket: socket.on("framesent", self._on_sent))
        self.page.on("request", lambda request: self.requested.append(request.url))
        if script:
            self.page.add_init_script(script)
        self._robot = robot
        self.address = address or f"https://127.0.0.1:{robot.port}/"
        key = robot.known.key if key is None else key
        self.page.goto(self.address + (f"#key={key}" if key else ""))

    def __enter__(self) -> Self:
        """The console itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the page."""
        self._context.close()

    def _on_console(self, kind: str, text: str) -> None:
        if kind == "error" and not any(message in text for message in _PROVOKED):
            self.errors.append(text)

    def _on_sent(self, message: str | bytes) -> None:
        self.sent.append(msgspec.msgpack.decode(message))

    def await_state(self, seconds: float = 60.0, /, **state: str) -> None:
        """Wait until the page is in a state, such as `robot="armed"`."""
        wanted = "".join(f"[data-{name}='{value}']" for name, value in state.items())
        self.page.locator(f"body{wanted}").wait_for(timeout=1000 * seconds)

    def arm(self) -> None:
        """Arm the robot as its driver.

        On a busy machine the robot's answer may come too late, and E must be pressed again.
        """
        self.await_state(link="open", view="drive")
        self.page.locator("body[data-robot='disarmed'], body[data-robot='emergency']").wait_for()
        for _ in range(_PRESSES):
            self.page.keyboard.press("e")
            with contextlib.suppress(TimeoutError):
                self.await_state(_PRESSED_S, robot="armed", driver="me")
                return
        raise AssertionError("The robot was not armed, though E was pressed.")

    def drive(self, key: str, pins: Pins, way: float = 0.0) -> None:
        """Hold a key until the robot moves, in the direction of the sign of `way` or in any.

        On a busy machine the page may receive nothing for so long that the key must be pressed
        again.
        """
        pins.forget()
        for _ in range(_PRESSES):
            self.page.keyboard.down(key)
            try:
                until(lambda: pins.moves(way), _PRESSED_S)
            except AssertionError:
                self.page.keyboard.up(key)
                with self._robot.operator() as operator:
                    operator.place(0)  # In twin time it may have reached a wall by now.
            else:
                return
        raise AssertionError(f"Nothing moved, though {key} was held: {self.state_of_robot()}")

    def state_of_robot(self) -> str:
        """Return the state of the robot and the log of the page, for error messages."""
        with self._robot.client(frames=False) as observer:
            seen = observer.ask().message
        log = self.page.locator("#log").inner_text().splitlines()
        state = [round(number, 2) for number in seen.state]
        return (
            f"{seen.stop_reason!r}, commanded {seen.commanded}, applied {seen.action_applied}, "
            f"armed {seen.armed}, state {state}; the page's log: {log[:8]}"
        )

    def stop(self) -> None:
        """Stop the robot, and wait until it has."""
        self.page.keyboard.press("Space")
        self.await_state(robot="emergency")

    def await_words(self, where: str, text: str) -> None:
        self.page.locator(where, has_text=text).first.wait_for(timeout=60_000)

    def pixels(self) -> list[int]:
        return self.page.evaluate(
            "() => { const c = document.getElementById('picture');"
            " return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data); }"
        )


class Pins:
    """Outputs of a robot's twin, read from its ledger.

    Unlike `read_ledger` this reads each line once, because it is called often and the ledger of a
    shared robot gets long.
    """

    def __init__(self, robot: RunningRobot) -> None:
        profile = next(robot.folder.glob("*.toml"))
        self._path = robot.ledger_path
        self._wiring = TwinWiring(load_profile(profile).guard_plan())
        with robot.operator() as operator:
            self._levels = operator.levels()
        self._read = max(0, self._path.stat().st_size - _RECENT)
        self._lines: list[Transition] = []
        self._pushes: list[float] = []
        self.forget()

    def propels(self) -> float:
        """Return the propelling output now, -1 to 1; 0 at rest."""
        self._look()
        return self._push()

    def forget(self) -> None:
        now = self.propels()
        self._pushes = [now] if now else []

    def await_motion(self, way: float = 0.0) -> None:
        """Wait until the robot moves, in the direction of the sign of `way` or in any."""
        until(lambda: self.moves(way), 60.0)

    def moves(self, way: float = 0.0) -> bool:
        """Return True if it was propelled since it was last at rest, in a direction or in any.

        A busy machine reads so seldom that a robot in twin time may be at a wall by then.
        """
        self._look()
        return any(push * (way or push) > 0.0 for push in self._pushes)

    def await_rest(self) -> None:
        until(lambda: self.propels() == 0.0, 60.0)
        self.forget()

    def last_rest_ns(self) -> float:
        """Return the time of the last rest in the ledger, ns; minus infinity for none."""
        self._look()
        ledger = sorted(self._lines, key=lambda line: line.t)
        return max((i.end_ns for i in propelled(ledger, self._wiring)), default=-math.inf)

    def _look(self) -> None:
        with self._path.open("rb") as file:
            file.seek(self._read)
            if self._read and not self._lines:
                self._read += len(file.readline())  # The rest of a line.
            whole, newline, _ = file.read().rpartition(b"\n")
        self._read += len(whole) + len(newline)
        for line in whole.splitlines():
            fields = json.loads(line)
            if fields["kind"] == "input":
                continue  # The edges of the encoder are many, and no output.
            known = {key: fields[key] for key in fields if key in Transition.__slots__}
            self._lines.append(Transition(**known))
            apply(self._levels, self._lines[-1])
            push = self._push()
            if push:
                self._pushes.append(push)

    def _push(self) -> float:
        """Return the propelling output after the last line."""
        if not self._lines:
            return 0.0
        outputs = self._wiring.read(self._levels, self._lines[-1].t)
        return max((outputs[name].value or 0.0 for name in self._wiring.propelling), key=abs)
