"""The guides to profiles and to the wire have every key, from the types that decode them."""

import re
from pathlib import Path

import pytest

from scripts.site_hooks import with_keys
from shapechanger.robot.cameras.camera import CAMERAS
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.link.messages import ClientMessage, RobotMessage
from shapechanger.robot.profile import shipped_profiles
from shapechanger.robot.profile.read import TABLES

DOCS = Path(__file__).parents[3] / "docs"
SOURCE = (DOCS / "profiles.md").read_text()


@pytest.fixture(scope="module", name="guide")
def _guide() -> str:
    return with_keys(SOURCE)


def test_every_key_of_a_profile_has_a_meaning(guide: str) -> None:
    rows = re.findall(r"^\| `(\w+)` \| (.*) \| (.*) \| (.*) \|$", guide, re.MULTILINE)
    assert len(rows) > 90
    assert [key for key, values, _, meaning in rows if not values or not meaning] == []
    assert ("deadline_ms", "a whole number from 20 to 1000", "250") in {row[:3] for row in rows}


def test_every_table_driver_and_profile_is_in_the_guide(guide: str) -> None:
    for table in TABLES:
        heading = re.escape(f"<!-- keys: profile {table} -->")
        assert re.search(rf"^### `\[+{table}[\].]", SOURCE, re.MULTILINE), table
        assert re.search(heading, SOURCE), table
    for names in (OUTPUTS, SENSORS, CAMERAS):
        assert all(f'#### `driver = "{name}"`' in guide for name in names)
    assert all(f'#### `over = "{name}"`' in guide for name in PULSES)
    assert all(f"`{name}`" in guide for name in shipped_profiles())


def test_every_message_is_in_the_guide_to_the_wire() -> None:
    page = with_keys((DOCS / "wire.md").read_text())
    for kind in (*ClientMessage.__subclasses__(), *RobotMessage.__subclasses__()):
        assert f"#### `{kind.__name__.lower()}`" in page
    assert "| `pace` | Literal['realtime', 'lockstep'] | \"realtime\" |" in page
    assert "| `seq` | int or None | none |" in page
