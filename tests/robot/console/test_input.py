"""Keys, gamepads and the stick must not drive by mistake, for example after a lost release."""

from collections.abc import Callable, Iterator
from typing import Any, Final

import pytest
from playwright.sync_api import CDPSession

from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.console.browser import Console
from tests.robot.twin.robots import until

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Visit = Callable[..., Console]

_DRIVING: Final = ("KeyW", "KeyA", "KeyS", "KeyD")
_PLACES: Final = (*_DRIVING, "KeyE", "KeyX", "KeyR", "KeyM", "KeyU", "Equal", "Minus")
LAYOUTS: Final = {
    "QWERTY": "w a s d e x r m u = -",
    "QWERTZ": "w a s d e x r m u \N{ACUTE ACCENT} \N{LATIN SMALL LETTER SHARP S}",
    "AZERTY": "z q s d e x r , u = )",
    "Dvorak": ", a o e . q p m g ] [",
    "Colemak": "w a r s f x p m l = -",
    "Bépo": "\N{LATIN SMALL LETTER E WITH ACUTE} a u i p y o q v % =",
    "Russian": " ".join("цфывучкьг=-"),
}
"""Characters of each layout for the keys of `_PLACES`, in the same order."""

# Messages that are not orders.
_QUIET: Final = {"acknowledge", "ping", "hello"}


class Input:
    """Input of a person at a console, and the orders that the page sends for it."""

    def __init__(self, console: Console) -> None:
        self.console = console
        self.page = console.page
        self._browser: CDPSession = self.page.context.new_cdp_session(self.page)

    def key(self, kind: str, code: str, key: str, modifiers: int = 0, **options: Any) -> None:
        """Press ("Down") or release ("Up") a key, given by its position and its character."""
        event = {"type": f"key{kind}", "code": code, "key": key, "modifiers": modifiers}
        self._browser.send("Input.dispatchKeyEvent", event | options)

    def tap(self, code: str, key: str, **options: Any) -> None:
        self.key("Down", code, key, **options)
        self.key("Up", code, key)

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """Send a touch event, "Start", "Move", "End" or "Cancel", with the points of fingers."""
        fingers = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
        event = {"type": f"touch{kind}", "touchPoints": fingers}
        self._browser.send("Input.dispatchTouchEvent", event)

    def orders(self) -> list[Any]:
        """Return orders since the last call; commands as signs of steering and throttle, once."""
        self._await_answers(2)
        sent, self.console.sent = self.console.sent, []
        orders: list[Any] = []
        for message in sent:
            kind = message["kind"]
            order = _signs(message["values"]) if kind == "command" else kind
            if kind not in _QUIET and orders[-1:] != [order]:
                orders.append(order)
        return orders

    def held(self) -> tuple[int, int]:
        """Return the command that the page sends now, after earlier commands have arrived."""
        self.orders()
        (order,) = self.orders()
        return order

    def _await_answers(self, count: int) -> None:
        self.page.evaluate("0")  # Earlier messages arrive before the result of this call.
        least = len(self.console.sent) + count

        def has_answered() -> bool:
            self.page.evaluate("0")
            return len(self.console.sent) >= least

        until(has_answered, 60.0)


def _signs(values: list[float]) -> tuple[int, int]:
    steering, throttle = ((value > 0) - (value < 0) for value in values)
    return steering, throttle


@pytest.fixture
def person(car: RunningRobot, visit: Visit) -> Iterator[Input]:
    """A person who has armed the car, with a cap so low that the car stays in place."""
    console = visit(car, script=_PADS)
    console.await_state(link="open", view="drive")
    console.page.locator("#cap").fill("10")
    console.page.focus("#stage")
    console.arm()
    person = Input(console)
    assert person.held() == (0, 0)
    yield person
    console.stop()


def test_a_key_has_one_meaning_on_every_layout(person: Input) -> None:
    """A key is identified by its position; driving keys are never shortcuts."""
    page, cap = person.page, person.page.locator("#cap")
    for name, letters in LAYOUTS.items():
        at = dict(zip(_PLACES, letters.split(), strict=True))

        def tap(code: str, at: dict[str, str] = at) -> list[Any]:
            person.tap(code, at[code])
            return [order for order in person.orders() if order != (0, 0)]

        for codes, order in ((("KeyW", "KeyD"), (1, 1)), (("KeyS", "KeyA"), (-1, -1))):
            for code in codes:
                person.key("Down", code, at[code])
            assert person.held() == order, name
            for code in codes:
                person.key("Up", code, at[code])
            assert person.held() == (0, 0), name
        assert tap("KeyR") == ["record"], name
        page.locator("body[data-recording=true]").wait_for()
        assert tap("KeyM") == ["mark"], name
        assert tap("KeyU") == ["undo"], name
        assert tap("KeyR") == ["record"], name
        page.locator("body[data-recording=false]").wait_for()
        person.tap("Equal", at["Equal"])
        assert cap.input_value() == "20", name
        assert tap("Minus") == [], name
        assert cap.input_value() == "10", name
        assert tap("KeyX") == ["disarm"], name
        # Driving keys do not arm a stopped robot.
        person.tap("Space", " ")
        assert "emergencystop" in person.orders()
        for code in _DRIVING:
            person.tap(code, at[code])
        assert person.orders() == [], name
        person.console.await_state(robot="emergency")
        assert tap("KeyE") == ["arm"], name
        person.console.await_state(robot="armed")


# Events after which the page may miss the release of a key, so that W must be pressed again.
_RELEASES: Final = {
    "Meta down": lambda person: person.key("Down", "MetaLeft", "Meta", 4),
    "Meta up": lambda person: person.key("Up", "MetaLeft", "Meta"),
    "Meta held": lambda person: person.key("Up", "KeyQ", "q", 4),
    "Control": lambda person: person.key("Down", "ControlLeft", "Control", 2),
    "Alt": lambda person: person.key("Down", "AltLeft", "Alt", 1),
    "AltGr": lambda person: person.key("Down", "AltRight", "AltGraph"),
    "the slider": lambda person: person.page.focus("#cap"),
    "a button": lambda person: person.page.focus("#leave"),
    "nothing focused": lambda person: person.page.evaluate("document.activeElement.blur()"),
    **{
        name: lambda person, event=event, on=on: person.page.evaluate(
            f"{on}.dispatchEvent(new Event('{event}', {{ bubbles: true }}))"
        )
        for name, event, on in (
            ("the window", "blur", "window"),
            ("a menu", "contextmenu", "document.body"),
            ("a drag", "dragstart", "document.body"),
            ("an input method", "compositionstart", "document.body"),
            ("full screen", "fullscreenchange", "document"),
            ("the pointer", "pointerlockchange", "document"),
        )
    },
}


def test_held_keys_are_released_with_modifiers_and_the_focus(person: Input) -> None:
    """After that, repeats and releases of the keys have no effect."""
    for name, release in _RELEASES.items():
        person.page.focus("#stage")
        person.key("Down", "KeyW", "w")
        assert person.held() == (0, 1), name
        release(person)
        assert person.held() == (0, 0), name
        person.key("Down", "KeyW", "w", autoRepeat=True)
        assert person.held() == (0, 0), name
        person.key("Up", "KeyW", "w")
        assert person.orders() == [(0, 0)], name


def test_combinations_and_input_methods_do_not_drive(person: Input) -> None:
    """Keys in a focused drop-down list do not drive either; a held Enter presses a button once."""
    for modifier in (1, 2, 4):
        for code, key in zip(_PLACES, LAYOUTS["QWERTY"].split(), strict=True):
            person.tap(code, key, modifiers=modifier, commands=[])
            assert person.orders() == [(0, 0)], (modifier, code)
    for code in _PLACES:
        for options in ("key: 'Dead'", "key: 'x', isComposing: true", "key: 'x', keyCode: 229"):
            person.page.evaluate(
                f"dispatchEvent(new KeyboardEvent('keydown', {{ code: '{code}', {options} }}))"
            )
        assert person.orders() == [(0, 0)], code
    person.page.evaluate("document.getElementById('policies').hidden = false")
    person.page.focus("#policy-name")
    for code, key in zip(_PLACES, LAYOUTS["QWERTY"].split(), strict=True):
        person.tap(code, key)
    assert person.orders() == [(0, 0)]
    person.page.focus("#arm")
    for is_repeat in (False, True, True, True):
        person.key("Down", "Enter", "Enter", autoRepeat=is_repeat, text="\r")
    person.key("Up", "Enter", "Enter")
    assert [order for order in person.orders() if order != (0, 0)] == ["disarm"]
    person.console.await_state(robot="disarmed")


def test_keys_held_while_another_person_arms_do_not_drive(car: RunningRobot, person: Input) -> None:
    """The held keys count again after they were released and pressed."""
    person.tap("KeyX", "x")
    person.console.await_state(robot="disarmed")
    person.key("Down", "KeyW", "w")
    with car.client(role="person", frames=False, name="Other") as other:
        other.ask()
        other.arm()
        person.console.await_state(robot="armed", driver="me")
    assert person.held() == (0, 0)
    person.key("Up", "KeyW", "w")
    person.key("Down", "KeyW", "w")
    assert person.held() == (0, 1)
    person.key("Up", "KeyW", "w")


_PADS: Final = """
globalThis.pads = [null, null];
Object.defineProperty(navigator, "getGamepads", { value: () => [...pads] });
globalThis.pad = (index, change, mapping = "standard") => {
  const was = pads[index];
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false, value: 0 }));
  const made = { index, id: "Pad", connected: true, mapping, axes: [0, 0, 0, 0], buttons };
  pads[index] = change && Object.assign(made, change);
  for (const [button, value] of change?.pressed ?? []) press(index, button, value);
  const name = change ? "gamepadconnected" : "gamepaddisconnected";
  if (!was !== !change) dispatchEvent(new Event(name));
};
globalThis.press = (index, button, value = 1) => {
  pads[index].buttons[button] = { pressed: value > 0.5, value };
};
"""


def test_a_gamepad_drives_only_after_a_rest_since_its_last_change(person: Input) -> None:
    """All inputs must rest whenever a pad is connected, disconnected or changes its index."""

    def pad(script: str) -> tuple[int, int]:
        person.page.evaluate(script)
        return person.held()

    rest, ahead = (0, 0), (0, 1)
    assert pad("pad(0, {})") == rest
    assert pad("pads[0].axes[1] = -1") == ahead
    # A second pad is connected and disconnected while the first pad is pushed.
    assert pad("pad(1, { axes: [0, 0, 0, -1] })") == rest
    assert pad("pads[0].axes[1] = 0") == rest
    assert pad("pads[0].axes[1] = -1") == ahead
    assert pad("pad(1, null)") == rest
    assert pad("pads[0].axes[1] = 0.05") == rest
    assert pad("pads[0].axes[1] = -1") == ahead
    # The pad changes its index without an event, and another pad at its index is not at rest.
    assert pad("pads = [null, { ...pads[0], index: 1 }]") == rest
    assert pad("pads = [null, null]") == rest
    assert pad("pad(1, { axes: [0, 0, 0, -1] }); pad(0, {})") == rest
    assert pad("pads[0].axes[1] = -1") == ahead
    assert pad("pads[0] = null") == rest
    assert pad("pad(1, null)") == rest
    # Two triggers report half their travel until they are touched.
    assert pad("pad(0, { pressed: [[6, 0.5], [7, 0.5]] })") == rest
    assert pad("press(0, 7, 0)") == rest
    assert pad("press(0, 6, 0)") == rest
    assert pad("press(0, 7, 1)") == ahead
    assert pad("pads[0].axes[0] = NaN") == rest
    assert pad("pads[0].axes[0] = 0") == rest
    assert pad("press(0, 7, 0)") == rest
    assert pad("press(0, 7, 1)") == ahead
    # Another window gets the focus, and then a key is pressed with Meta.
    assert pad("document.hasFocus = () => false") == rest
    assert pad("press(0, 7, 0); press(0, 0)") == rest
    assert pad("press(0, 0, 0); document.hasFocus = () => true") == rest
    assert pad("press(0, 7, 1)") == ahead
    person.tap("MetaLeft", "Meta")
    assert person.held() == rest
    person.page.evaluate("press(0, 1)")
    person.console.await_state(robot="emergency")
    person.page.evaluate("pad(0, null)")


def test_a_gamepad_of_unknown_mapping_is_ignored(person: Input) -> None:
    for change in ("{ axes: [0, 0, 0, 0, 0, 0] }", "{ axes: [0, 0, -1, -1, 0, -1] }"):
        person.page.evaluate(f"pad(0, {change}, '')")
        assert person.held() == (0, 0)
    person.page.evaluate("pads[0].axes[1] = -1; press(0, 7); press(0, 1)")
    assert person.held() == (0, 0)
    person.console.await_words("#log", 'The gamepad "Pad" is ignored')
    # Another pad is used; a button that is held while it is connected does not arm.
    person.tap("KeyX", "x")
    person.console.await_state(robot="disarmed")
    person.orders()
    for script in ("pad(1, { pressed: [[0, 1]] })", "press(1, 0, 0)"):
        person.page.evaluate(script)
        assert person.orders() == []
    person.page.evaluate("press(1, 0)")
    person.console.await_state(robot="armed")
    person.page.evaluate("pad(0, null); pad(1, null)")


def test_the_stick_returns_to_its_centre_after_any_end_of_a_press(person: Input) -> None:
    """The press ends with one of two mouse buttons, a cancelled touch, or one of two fingers."""
    page = person.page
    box = page.locator("#pad").bounding_box()
    assert box is not None
    x, top, bottom = box["x"] + box["width"] / 2, box["y"] + 5, box["y"] + 0.9 * box["height"]
    page.focus("#stage")
    page.mouse.move(x, top)
    page.mouse.down()
    assert person.held() == (0, 1)
    page.mouse.down(button="right")
    page.mouse.up()
    assert person.held() == (0, 0)
    page.mouse.move(x, bottom)
    page.mouse.up(button="right")
    assert person.held() == (0, 0)
    page.mouse.down()
    assert person.held() == (0, -1)
    # The page has not received the pointerup event.
    page.evaluate(
        "document.getElementById('pad').dispatchEvent("
        "new PointerEvent('pointermove', { pointerId: 1, buttons: 0 }))"
    )
    assert person.held() == (0, 0)
    page.mouse.up()
    for ends in (("Cancel",), ("End",)):
        person.touch("Start", (x, top))
        assert person.held() == (0, 1)
        person.touch("Start", (x, top), (x, bottom))
        assert person.held() == (0, 1)
        for end in ends:
            person.touch(end)
        assert person.held() == (0, 0)
