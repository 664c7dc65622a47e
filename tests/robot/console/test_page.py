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


def test_the_key_is_removed_from_the_address(car: RunningRobot, visit: Visit) -> None:
    """The key is stored only on request; "leave" deletes it, and then the page shows a form."""
    console = visit(car)
    page = console.page
    console.await_state(link="open", view="drive")
    assert page.url == console.address
    assert page.evaluate("sessionStorage.length + localStorage.length") == 0
    page.focus("#keep")
    page.keyboard.press("Enter")
    page.reload()
    console.await_state(link="open", view="drive")
    page.click("#leave")
    page.reload()
    console.await_words("#connection", "Not connected.")
    assert page.locator("#key-form").is_visible()
    assert page.locator("#drive").is_hidden()
    assert page.evaluate("document.title") == "test-car"
    trusting = ssl._create_unverified_context()
    url = f"{console.address}console/robot.json"
    with urllib.request.urlopen(url, context=trusting) as answer:
        assert set(json.load(answer)) == {"robot", "version", "certificate", "open"}


def test_a_wrong_key_is_an_error_and_keeps_the_form(car: RunningRobot, visit: Visit) -> None:
    console = visit(car, key="ABCD-EFGH")
    page, other = console.page, new_key().lower()
    console.await_words("#key-trouble", "A key has 26 letters and digits, got 8.")
    assert page.input_value("#key") == "ABCD-EFGH"
    page.fill("#name", "Ada")
    for key, text in ((other, "Wrong key."), ("!" * 26, "only the letters A to Z and the digits")):
        page.fill("#key", key)
        page.keyboard.press("Enter")
        console.await_words("#key-trouble", text)
        assert (page.input_value("#key"), page.input_value("#name")) == (key, "Ada")
    page.fill("#key", car.known.key.replace("-", " ").lower())
    page.click("#enter")
    console.await_state(link="open", view="drive")


def test_every_control_has_an_accessible_name(car: RunningRobot, visit: Visit) -> None:
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
    assert [role for role, name in tree if role in controls and not name.strip()] == []
    assert {"banner", "main", "status", "log", "heading"} <= {role for role, _ in tree}
    first = "[...document.querySelectorAll('button, input, [tabindex]')]"
    assert console.page.evaluate(f"{first}.find((e) => e.checkVisibility()).id") == "stop"


@pytest.mark.parametrize("size", [DESK, PHONE, PHONE_ON_ITS_SIDE])
def test_controls_are_large_and_do_not_overlap(
    car: RunningRobot, visit: Visit, size: dict[str, Any]
) -> None:
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
        # On an upright phone, sticky elements cover elements that are scrolled below them.
        boxes = [box for box in boxes if box[0] not in ("stop", "arm", "hand")]
    for (one, x, y, w, h), (other, u, v, s, t) in itertools.combinations(boxes, 2):
        apart = x + w <= u + 1 or u + s <= x + 1 or y + h <= v + 1 or v + t <= y + 1
        assert apart, (one, other)
    picture = next(box for box in boxes if box[0] == "picture")
    assert picture[3] * picture[4] >= 0.25 * width * size["viewport"]["height"]
