"""The guide to profiles matches the schema."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from shapechanger.robot.profile import schema, shipped_profiles
from shapechanger.robot.profile.schema import ProfileKey
from tests.robot.profile.texts import read

GUIDE = (Path(__file__).parents[3] / "docs" / "profiles.md").read_text()


def test_vehicle_of_the_guide_is_a_profile() -> None:
    """The example of the guide is a valid profile."""
    (text,) = re.findall(r"```toml\n(.*?)```", GUIDE, re.DOTALL)
    assert read(text).body == "hovercraft"


@pytest.mark.parametrize("name", [n for n in vars(schema) if n.endswith(("KEYS", "SETTINGS"))])
def test_every_key_is_in_the_guide(name: str) -> None:
    """The guide lists each key with its choices and its default."""
    table = getattr(schema, name)
    keys: list[ProfileKey] = (
        [k for ks in table.values() for k in ks] if "SETTINGS" in name else [*table]
    )
    for key in keys:
        assert f"`{key.name}`" in GUIDE
        assert [n for n in key.names if n and f'"{n}"' not in GUIDE and f"`{n}`" not in GUIDE] == []
        rows = re.findall(rf"^\| `{key.name}` \| (.*?) \|", GUIDE, re.MULTILINE)
        if rows and type(key.default) in (int, float) and key.name != "address":
            assert any(row.startswith(f"{key.default:g}") for row in rows)


def test_every_table_and_profile_is_in_the_guide() -> None:
    """The guide lists each table and each shipped profile."""
    for table in schema.TABLES:
        assert re.search(rf"^### `\[+{table}[\].]", GUIDE, re.MULTILINE), table
    for name in shipped_profiles():
        assert f"| `{name}` |" in GUIDE
