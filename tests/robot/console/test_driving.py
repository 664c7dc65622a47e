"""Driving and stopping with the console."""

from collections.abc import Callable

import pytest
from playwright.sync_api import Error

from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.console.browser import PHONE, Console, Pins
from tests.robot.twin.robots import until

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Visit = Callable[..., Console]

_MINUS = "\N{MINUS SIGN}"


def test_the_live_picture_changes(car: RunningRobot, visit: Visit) -> None:
    console = visit(car)
    console.await_state(picture="live")
    before = console.pixels()
    assert len(before) == 160 * 120 * 4
    assert len(set(before)) > 10
    until(lambda: console.pixels() != before, 60.0)


def test_a_key_drives_until_it_is_released(car: RunningRobot, visit: Visit) -> None:
    console, pins = visit(car), Pins(car)
    console.arm()
    for key, way in (("s", -1.0), ("ArrowDown", -1.0), ("w", 1.0)):
        assert pins.propels() == 0.0
        console.drive(key, pins, way)
        console.page.keyboard.up(key)
        pins.await_rest()
    console.stop()


def test_a_hidden_page_stops_and_disarms(car: RunningRobot, visit: Visit) -> None:
    console, pins = visit(car), Pins(car)
    console.arm()
    console.drive("w", pins)
    console.page.evaluate(
        "Object.defineProperty(document, 'hidden', {configurable: true, value: true});"
        "document.dispatchEvent(new Event('visibilitychange'))"
    )
    pins.await_rest()
    console.page.evaluate(
        "delete document.hidden; document.dispatchEvent(new Event('visibilitychange'))"
    )
    console.await_state(robot="disarmed")


def test_a_page_that_dies_stops_the_robot_within_the_deadline(
    hasty_car: RunningRobot, visit: Visit
) -> None:
    """The page's process crashes without sending a message, the worst case of a closed tab."""
    console, pins = visit(hasty_car), Pins(hasty_car)
    console.arm()
    console.drive("w", pins)
    with hasty_car.client(frames=False) as observer:
        before = observer.ask().message
        with pytest.raises(Error, match="crash"):
            console.page.goto("chrome://crash")
        pins.await_deadline(observer, before)
        until(lambda: not observer.ask().message.armed, 60.0)


@pytest.mark.parametrize(
    ("key", "focus"),
    [("Space", "#stage"), ("Space", "#leave"), ("Escape", "#cap"), ("Escape", "#log")],
)
def test_space_and_escape_stop_the_robot_with_any_focus(
    car: RunningRobot, visit: Visit, key: str, focus: str
) -> None:
    """Space and Escape do not press a focused button; only arming ends the stop."""
    console, pins = visit(car), Pins(car)
    console.arm()
    console.drive("w", pins)
    console.page.focus(focus)
    console.page.keyboard.press(key)
    pins.await_rest()
    console.await_state(robot="emergency", view="drive", driver="me")
    console.page.keyboard.up("w")


def test_the_stop_button_acts_on_pointer_down(car: RunningRobot, visit: Visit) -> None:
    """The click after the pointer-down does not count as a second stop."""
    console, pins = visit(car), Pins(car)
    console.arm()
    console.drive("w", pins)
    console.page.hover("#stop")
    console.page.mouse.down()
    pins.await_rest()
    console.await_state(robot="emergency")
    with car.client(frames=False) as observer:
        stops = observer.ask().message.emergencies
        console.page.mouse.up()
        console.await_words("#log", "STOP was pressed.")
        console.page.keyboard.press("x")
        console.arm()
        assert observer.ask().message.emergencies == stops
    console.stop()


def test_tilting_a_phone_drives(car: RunningRobot, visit: Visit) -> None:
    """Tilt is relative to the pose at which it was enabled; tilting away drives forward."""
    console, pins = visit(car, **PHONE), Pins(car)
    console.arm()
    browser = console.page.context.new_cdp_session(console.page)
    button = console.page.get_by_role("button", name="Tilt to drive")
    console.page.evaluate("addEventListener('deviceorientation', (e) => { tilted = e.beta; })")

    def tilt(beta: float) -> None:
        turned = {"alpha": 0.0, "beta": beta, "gamma": 0.0}
        browser.send("DeviceOrientation.setDeviceOrientationOverride", turned)
        until(lambda: abs(console.page.evaluate("globalThis.tilted ?? 0") - beta) < 0.1, 60.0)

    tilt(45.0)
    button.click()
    tilt(44.0)
    assert pins.propels() == 0.0
    for beta, way in ((15.0, 1.0), (75.0, -1.0)):
        tilt(beta)
        pins.await_motion(way)
        tilt(45.0)
        pins.await_rest()
    tilt(75.0)
    pins.await_motion(-1.0)
    button.click()
    pins.await_rest()
    console.stop()


def test_the_cap_scales_commands(car: RunningRobot, visit: Visit) -> None:
    console, pins = visit(car), Pins(car)
    keyboard = console.page.keyboard
    console.arm()
    for _ in range(3):
        keyboard.press("-")
    console.await_words("#cap-shown", "20 %")
    keyboard.down("s")
    console.await_words("#actions", f"{_MINUS}0.20 → {_MINUS}0.20")
    pins.await_motion(-1.0)
    keyboard.up("s")
    keyboard.down("a")
    text = f"A steering of {_MINUS}0.20 moves nothing here: raise the cap."
    console.await_words("#pad-info", text)
    keyboard.up("a")
    console.stop()
