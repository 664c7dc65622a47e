"""The site: its wiring diagrams, links, API reference and accessibility."""

from __future__ import annotations

import functools
import importlib.util
import os
import re
import subprocess
import sys
import threading
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import gymnasium as gym
import pytest

from scripts.site_pages import public_names, reference_path
from scripts.wiring_diagrams import DIVIDER, devices_of, draw_wiring, part_list, pin_table
from shapechanger.contract.plan import driven_pins
from shapechanger.envs.catalogue import ODRL_ENVS
from shapechanger.robot.drivers.pins import BCM_OF_BOARD
from shapechanger.robot.profile import Profile, load_profile, read_profile, shipped_profiles
from tests.drawing import missing
from tests.robot.profile.texts import EVERYTHING, HOVERCRAFT

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROOT: Final = Path(__file__).parents[1]
POSITIONS: Final = {pin: position for position, pin in BCM_OF_BOARD.items()}
OTHERS: Final = {"rover": EVERYTHING, "skimmer": HOVERCRAFT}
"""Profiles with drivers that no shipped profile uses."""


@pytest.fixture(params=sorted([*shipped_profiles(), *OTHERS]))
def profile(request: pytest.FixtureRequest) -> Profile:
    """A shipped profile, or a profile with other drivers."""
    if request.param in OTHERS:
        return read_profile(OTHERS[request.param], Path(f"{request.param}.toml"))
    return load_profile(shipped_profiles()[request.param])


def pins_of(profile: Profile) -> set[int]:
    """Return the BCM pins of a profile's outputs, sensors and buttons, read from its settings."""
    found = set(driven_pins(profile))
    for sensor in profile.sensors:
        settings = sensor.settings
        found |= {settings[key] for key in ("a", "b", "trigger", "echo") if key in settings}
        found |= set(settings.get("pins", ()))
    for output in profile.outputs:
        found.add(output.settings.get("output_enable", -1))
    devices = [*profile.outputs, *profile.sensors]
    if any("bus" in device.settings for device in devices):
        found |= {2, 3}
    return (found | ({profile.stop_pin} if profile.stop_pin is not None else set())) - {-1}


def test_diagrams_show_every_pin_of_a_profile(profile: Profile) -> None:
    picture = draw_wiring(profile, "it")
    root = ET.fromstring(picture)
    assert root.get("role") == "img"
    assert str(root.get("aria-label")).startswith("Wiring of it: ")
    shown = {int(pin) for pin in re.findall(r"GPIO(\d+) ", picture)}
    assert shown == pins_of(profile)
    table = pin_table(profile)
    assert {int(pin) for pin in re.findall(r"^\| GPIO(\d+) ", table, re.MULTILINE)} == shown
    for pin in shown:
        assert f"GPIO{pin} ({POSITIONS[pin]})" in picture
        assert f"| GPIO{pin} | {POSITIONS[pin]} |" in table


def test_pins_that_move_something_have_resistors(profile: Profile) -> None:
    """Each pin of a motor driver is pulled, so that it is off while the computer starts."""
    all_wires = [wire for device in devices_of(profile) for wire in device.terminals]
    wires = [wire for wire in all_wires if wire.pull not in ("", DIVIDER)]
    pulled = {wire.source: wire.pull for wire in wires}
    assert set(driven_pins(profile)) <= set(pulled)
    enables = {one.settings.get("output_enable", -1) for one in profile.outputs} - {-1}
    assert {pin for pin, net in pulled.items() if net == "3.3 V"} == enables
    if pulled:
        assert f"| resistor 10 kOhm | {len(wires)} |" in part_list(profile)
    assert draw_wiring(profile, "it").count(">10 kΩ to ") == len(wires)


def test_the_one_shot_has_the_time_of_the_profile() -> None:
    """For 100 ms the resistor has the value in docs/hardware.md, and for 50 ms half of it."""
    assert "220 kΩ to 3.3 V" in draw_wiring(load_profile(shipped_profiles()["car"]), "car")
    assert "R = 220 kOhm" in (ROOT / "docs" / "hardware.md").read_text()
    assert "110 kΩ to 3.3 V" in draw_wiring(read_profile(EVERYTHING, Path("rover.toml")), "rover")


def test_the_guide_of_the_car_has_its_pins() -> None:
    """The table of docs/build.md has the pins of the shipped car, and its resistors."""
    text = (ROOT / "docs" / "build.md").read_text()
    car = load_profile(shipped_profiles()["car"])
    for pin in pins_of(car):
        assert f"| GPIO{pin} | {POSITIONS[pin]} |" in text
    for device in devices_of(car):
        for wire in device.terminals:
            if device.title == "H-bridge" and isinstance(wire.source, int):
                row = rf"\| GPIO{wire.source} \| \d+ \| bridge {wire.label} .*10 kOhm to ground"
                assert re.search(row, text)


@contextmanager
def _served(folder: Path) -> Iterator[str]:

    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: Any) -> None:
            pass

    handler = functools.partial(Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()


LOOKED_AT: Final = (
    # Page, scheme and width of the window, pixels.
    ("index.html", "light", 1280),
    ("index.html", "dark", 390),
    ("environments/ExtendedAnt.html", "light", 390),
    ("wiring/lab-car.html", "dark", 1280),
    ("api/shapechanger.morphology.html", "dark", 1280),
)


def _require(*packages: str) -> None:
    for package in packages:
        if importlib.util.find_spec(package) is None:
            missing(f"The package {package} is not installed")


@pytest.mark.system
def test_the_site(tmp_path: Path, chromium: Browser) -> None:
    """The site builds strictly, has every public name and env, is accessible and self-contained."""
    _require("material", "mkdocstrings", "axe_playwright_python")
    site = tmp_path / "site"
    # With `--quiet`, warnings would not count.
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(site)],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        check=False,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    for package, names in public_names().items():
        page = (site / "api" / f"{package}.html").read_text()
        for name in names:
            described = (
                f'id="{reference_path(package, name)}"' in page or f"<code>{name}</code>" in page
            )
            assert described, f"{package}.{name}"
        assert "<blockquote>" not in page, f"{package}: an example outside a code block"
    odrl = (site / "environments" / "ODRL.html").read_text()
    for env_id in gym.registry:
        if env_id in ODRL_ENVS:
            assert env_id in odrl
        elif env_id.startswith("shapechanger/"):
            assert (site / "environments" / f"{env_id[13:-3]}.html").exists(), env_id
    # From a comment of docs/build.md, which a code host hides.
    assert 'href="wiring/car.html"' in (site / "build.html").read_text()
    # Links out of docs, and into docs from the README.
    assert 'href="examples/two_bodies.py"' in (site / "examples.html").read_text()
    assert 'href="atlas.html"' in (site / "index.html").read_text()
    with _served(site) as address:
        for page, scheme, width in LOOKED_AT:
            _look(chromium, address, page, scheme, width)


def _look(chromium: Browser, address: str, path: str, scheme: Any, width: int) -> None:
    """Check layout, errors, accessibility and requests of a page in a browser."""
    from axe_playwright_python.sync_playwright import Axe

    where = f"{path}, {scheme}, {width} pixels"
    requested: list[str] = []
    errors: list[str] = []
    context = chromium.new_context(
        viewport={"width": width, "height": 900}, color_scheme=scheme, reduced_motion="reduce"
    )
    try:
        page = context.new_page()
        page.on("request", lambda request: requested.append(request.url))
        page.on("pageerror", lambda error: errors.append(str(error)))
        page.goto(address + path)
        page.wait_for_load_state("networkidle")
        wider = "document.documentElement.scrollWidth > document.documentElement.clientWidth"
        assert not page.evaluate(wider), f"{where}: the page scrolls sideways"
        found = [
            (one["id"], [node["target"] for node in one["nodes"]])
            for one in Axe().run(page).response["violations"]
            if one["impact"] in ("serious", "critical")
        ]
        assert (where, found, errors) == (where, [], [])
        others = [url for url in requested if not url.startswith((address, "data:", "blob:"))]
        assert (where, others) == (where, [])
    finally:
        context.close()
