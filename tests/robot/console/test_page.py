"""Access, requests and accessibility of the console."""

import itertools
import json
import ssl
import urllib.request
from collections.abc import Callable
from typing import Any

import pytest

from shapechanger.robot.link.authentication import new_key
from shapechanger.robot.twin.robot import RunningRobot
from tests.robot.console.browser import DESK, PHONE, PHONE_ON_ITS_SIDE, Console

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Visit = Callable[..., Console]


def test_without_the_key_only_the_form_and_the_name_are_shown(
    car: RunningRobot, visit: Visit
) -> None:
    """Without a key the robot reveals its name, version and certificate only."""
    console = visit(car, key="")
    console.await_words("#robot", "test-car")
    assert console.page.locator("#key-form").is_visible()
    assert console.page.locator("#drive").is_hidden()
    assert console.page.evaluate("document.title") == "test-car"
    trusting = ssl._create_unverified_context()
    url = f"{console.address}console/robot.json"
    with urllib.request.urlopen(url, context=trusting) as answer:
        revealed = set(json.load(answer))
    assert revealed == {"robot", "version", "certificate", "open"}


def test_the_key_is_removed_from_the_address(car: RunningRobot, visit: Visit) -> None:
    """The key is stored only on request, and "leave" deletes it."""
    console = visit(car)
    console.await_state(link="open", view="drive")
    assert console.page.url == console.address
    assert console.page.evaluate("sessionStorage.length + localStorage.length") == 0
    console.page.focus("#keep")
    console.page.keyboard.press("Enter")
    console.page.reload()
    console.await_state(link="open", view="drive")
    console.page.click("#leave")
    console.page.reload()
    console.await_words("#connection", "Not connected.")
    assert console.page.locator("#key-form").is_visible()


def test_a_wrong_key_is_an_error_and_keeps_the_form(car: RunningRobot, visit: Visit) -> None:
    console = visit(car, key="ABCD-EFGH")
    trouble = "#key-trouble"
    console.await_words(trouble, "A key has 26 letters and digits, got 8.")
    assert console.page.input_value("#key") == "ABCD-EFGH"
    other = new_key()
    console.page.fill("#key", other.lower())
    console.page.fill("#name", "Ada")
    console.page.keyboard.press("Enter")
    console.await_words(trouble, "Wrong key.")
    assert console.page.input_value("#key") == other.lower()
    assert console.page.input_value("#name") == "Ada"
    console.page.fill("#key", "!" * 26)
    console.page.keyboard.press("Enter")
    console.await_words(trouble, "only the letters A to Z and the digits 2 to 7")
    console.page.fill("#key", car.known.key.replace("-", " ").lower())
    console.page.click("#enter")
    console.await_state(link="open", view="drive")


def test_every_control_has_an_accessible_name(car: RunningRobot, visit: Visit) -> None:
    """The accessibility tree has landmarks, and STOP is first in the focus order."""
    console = visit(car)
    console.await_state(picture="live")
    session = console.page.context.new_cdp_session(console.page)
    nodes = session.send("Accessibility.getFullAXTree")["nodes"]
    tree = [
        (node.get("role", {}).get("value"), node.get("name", {}).get("value", ""))
        for node in nodes
        if not node["ignored"]
    ]
    controls = {"button", "slider", "textbox", "checkbox", "application", "log", "image"}
    named = {(role, name) for role, name in tree if role in controls}
    assert [role for role, name in named if not name.strip()] == []
    assert len([role for role, _ in named if role == "button"]) >= 8
    roles = {role for role, _ in tree}
    assert {"banner", "main", "status", "log", "heading"} <= roles
    first = console.page.evaluate(
        "[...document.querySelectorAll('button, input, [tabindex]')]"
        ".find((e) => e.checkVisibility()).id"
    )
    assert first == "stop"


@pytest.mark.parametrize("size", [DESK, PHONE, PHONE_ON_ITS_SIDE])
def test_controls_are_large_and_do_not_overlap(
    car: RunningRobot, visit: Visit, size: dict[str, Any]
) -> None:
    """On desktop and phone, targets are large enough and fit the screen width."""
    console = visit(car, **size)
    console.await_state(picture="live")
    page = console.page
    width = size["viewport"]["width"]
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    boxes = page.evaluate(
        """() => [...document.querySelectorAll('#drive button, #drive input, #picture, #pad')]
          .filter((e) => e.checkVisibility())
          .map((e) => [e.id, ...Object.values(e.getBoundingClientRect().toJSON()).slice(0, 4)])"""
    )
    assert len(boxes) >= 9
    for name, _, _, w, h in boxes:
        assert (w >= 40 and h >= 32) or name == "", name
    if size is not PHONE_ON_ITS_SIDE and size is not DESK:
        # Sticky elements of an upright phone cover what is scrolled below them.
        boxes = [box for box in boxes if box[0] not in ("stop", "arm", "hand")]
    for (one, x, y, w, h), (other, u, v, s, t) in itertools.combinations(boxes, 2):
        apart = x + w <= u + 1 or u + s <= x + 1 or y + h <= v + 1 or v + t <= y + 1
        assert apart, (one, other)
    picture = next(box for box in boxes if box[0] == "picture")
    assert picture[3] * picture[4] >= 0.25 * width * size["viewport"]["height"]
