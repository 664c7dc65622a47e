"""The guide to profiles matches the tables and the chips."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shapechanger.robot.drivers.as5600 import JointKeys
from shapechanger.robot.drivers.chip import OUTPUTS, PULSES, SENSORS
from shapechanger.robot.profile import shipped_profiles
from shapechanger.robot.profile.read import CAMERAS, GIVEN, TABLES
from shapechanger.robot.profile.toml import fields_of
from tests.robot.profile.texts import read

GUIDE = (Path(__file__).parents[3] / "docs" / "profiles.md").read_text()
KINDS = {
    *(kind for kinds in TABLES.values() for kind in kinds),
    *(chip.keys for chips in (OUTPUTS, PULSES, SENSORS) for chip in chips.values()),
    *CAMERAS.values(),
    JointKeys,
}


def test_vehicle_of_the_guide_is_a_profile() -> None:
    (text,) = re.findall(r"```toml\n(\[robot\].*?)```", GUIDE, re.DOTALL)
    assert read(text).body == "hovercraft"


@pytest.mark.parametrize("kind", sorted(KINDS, key=lambda kind: kind.__name__))
def test_every_key_is_in_the_guide(kind: type) -> None:
    """The guide lists each key with its choices and its default."""
    for name, field in fields_of(kind).items():
        if name in GIVEN:
            continue
        assert f"`{name}`" in GUIDE
        choices = [n for n in getattr(field.type, "values", ()) if isinstance(n, str) and n]
        assert [n for n in choices if f'"{n}"' not in GUIDE and f"`{n}`" not in GUIDE] == []
        rows = re.findall(rf"^\| `{name}` \| (.*?) \|", GUIDE, re.MULTILINE)
        default = field.default
        if rows and type(default) in (int, float) and name not in ("address", "low"):
            assert any(row.startswith(f"{default:g}") for row in rows) or name == "camera_stale_ms"


def test_every_table_driver_and_profile_is_in_the_guide() -> None:
    for table in TABLES:
        assert re.search(rf"^### `\[+{table}[\].]", GUIDE, re.MULTILINE), table
    for chips in (OUTPUTS, PULSES, SENSORS):
        for name in chips:
            assert f"`{name}`" in GUIDE or f'"{name}"' in GUIDE
    for name in shipped_profiles():
        assert f"| `{name}` |" in GUIDE
