"""The console in a browser, and the outputs of the robot that it drives."""

from __future__ import annotations

import contextlib
from typing import Any, Final, Self

import msgspec
from playwright.sync_api import Browser, Page, TimeoutError

from shapechanger.robot.client.client import RobotClient
from shapechanger.robot.link.messages import Observation
from shapechanger.robot.twin.ledger import Transition
from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.twin.robots import until

DESK: Final[dict[str, Any]] = {"viewport": {"width": 1280, "height": 800}}
_UPRIGHT: Final = {"width": 390, "height": 844}
PHONE: Final[dict[str, Any]] = {"viewport": _UPRIGHT, "has_touch": True, "is_mobile": True}
PHONE_ON_ITS_SIDE: Final[dict[str, Any]] = PHONE | {"viewport": {"width": 844, "height": 390}}

# Pins of the drive of `CAR`, forward and backward.
_DRIVE: Final = (22, 27)

_DEADLINE_MS: Final = 250.0
# Tolerance of a stop after the deadline, ms: ticks of the guard, and delays of a busy machine.
_SLACK_MS: Final = 60.0
_PRESSES: Final = 6
_PRESSED_S: Final = 10.0
# Errors that Chromium logs for failures that tests cause on purpose.
_PROVOKED: Final = ("net::ERR_", "WebSocket connection to")


class Console:
    """A page of the console in its own browser context, with options such as `PHONE`.

    `key` is in the page's address: None for the robot's key, "" for none. `script` runs before the
    scripts of the page. `errors` has errors of the page's scripts and of the browser, such as
    policy violations, and `sent` the messages that the page has sent to the robot.
    """

    def __init__(
        self,
        browser: Browser,
        robot: RunningRobot,
        *,
        key: str | None = None,
        script: str = "",
        **options: Any,
    ) -> None:
        self._context = browser.new_context(ignore_https_errors=True, **(DESK | options))
        self._context.set_default_timeout(60_000)
        self.page: Page = self._context.new_page()
        self.errors: list[str] = []
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.on("console", lambda message: self._on_console(message.type, message.text))
        self.sent: list[dict[str, Any]] = []
        self.page.on("websocket", lambda socket: socket.on("framesent", self._on_sent))
        if script:
            self.page.add_init_script(script)
        self._robot = robot
        self.address = f"https://127.0.0.1:{robot.port}/"
        key = robot.known.key if key is None else key
        self.page.goto(self.address + (f"#key={key}" if key else ""))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._context.close()

    def _on_console(self, kind: str, text: str) -> None:
        if kind == "error" and not any(message in text for message in _PROVOKED):
            self.errors.append(text)

    def _on_sent(self, message: str | bytes) -> None:
        self.sent.append(msgspec.msgpack.decode(message))

    def await_state(self, seconds: float = 60.0, /, **state: str) -> None:
        wanted = "".join(f"[data-{name}='{value}']" for name, value in state.items())
        self.page.locator(f"body{wanted}").wait_for(timeout=1000 * seconds)

    def arm(self) -> None:
        """Take control and arm; a busy robot may answer too late, so E is pressed again."""
        self.await_state(link="open", view="drive")
        self.page.locator("body[data-robot='disarmed'], body[data-robot='emergency']").wait_for()
        for _ in range(_PRESSES):
            self.page.keyboard.press("e")
            with contextlib.suppress(TimeoutError):
                self.await_state(_PRESSED_S, robot="armed", driver="me")
                return
        raise AssertionError("The robot was not armed, though E was pressed.")

    def drive(self, key: str, pins: Pins, way: float = 0.0) -> None:
        """Hold a key until `pins` move; a busy page may miss it, so it is pressed again."""
        pins.forget()
        for _ in range(_PRESSES):
            self.page.keyboard.down(key)
            try:
                until(lambda: pins.moves(way), _PRESSED_S)
            except AssertionError:
                self.page.keyboard.up(key)
                with self._robot.operator() as operator:
                    operator.place(0)  # In twin time, the car may have reached a wall.
            else:
                return
        raise AssertionError(f"The robot did not move, though {key} was held.")

    def stop(self) -> None:
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
    """The pins of a car's drive, read from the ledger of its twin.

    Unlike `read_ledger`, it reads each line once, because it is called often and the ledger of a
    shared robot gets long. `rest_ns` is the time at which the drive last came to rest, or 0.
    """

    def __init__(self, robot: RunningRobot) -> None:
        self._path = robot.ledger_path
        self._read = 0
        self._duties = dict.fromkeys(_DRIVE, 0.0)
        self._pushes: list[float] = []
        self.rest_ns = 0
        self.forget()

    def propels(self) -> float:
        """Return the duty of the drive now, -1 to 1; 0 at rest."""
        with self._path.open("rb") as file:
            file.seek(self._read)
            whole, newline, _ = file.read().rpartition(b"\n")
        self._read += len(whole) + len(newline)
        for line in whole.splitlines():
            if b'"kind": "pin"' not in line:
                continue  # Skip the many edges of the encoder, which is not an output.
            change = msgspec.json.decode(line, type=Transition)
            if change.pin in self._duties:
                self._duties[change.pin] = 0.0 if change.released else change.duty or 0.0
                self._pushes.append(self._push())
                if not self._push():
                    self.rest_ns = change.t
        return self._push()

    def forget(self) -> None:
        self._pushes = [self.propels()]

    def await_motion(self, way: float = 0.0) -> None:
        until(lambda: self.moves(way), 60.0)

    def moves(self, way: float = 0.0) -> bool:
        """Return True if the car has moved in the direction of `way`, or any, since `forget`."""
        self.propels()
        return any(push * (way or push) > 0.0 for push in self._pushes)

    def await_rest(self) -> None:
        until(lambda: self.propels() == 0.0, 60.0)
        self.forget()

    def await_deadline(self, observer: RobotClient, before: Observation) -> None:
        """Wait for rest, and check that it begins within the deadline after the last command."""
        commands = [before.command_ns or 0]

        def rests() -> bool:
            commands.append(observer.ask().message.command_ns or 0)
            return self.propels() == 0.0

        until(rests, 60.0)
        assert max(commands) > 0
        assert (self.rest_ns - max(commands)) / 1e6 <= _DEADLINE_MS + _SLACK_MS

    def _push(self) -> float:
        forward, backward = self._duties.values()
        return forward - backward
