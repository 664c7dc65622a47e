"""The tables of docs/wire.md have every message and every field."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, Final

import pytest

from shapechanger.robot.link.messages import (
    MAX_CLIENT_MESSAGE,
    VERSION,
    ClientMessage,
    EpisodeSummary,
    Hello,
    Observation,
    RobotMessage,
    Welcome,
)

PAGE: Final = (Path(__file__).parents[3] / "docs" / "wire.md").read_text()
MESSAGES: Final = [*ClientMessage.__subclasses__(), *RobotMessage.__subclasses__()]


def rows(head: str) -> dict[str, str]:
    """Return the rows of each table with this head: all fields of a row by each name in front."""
    found: dict[str, str] = {}
    for table in re.findall(rf"^{re.escape(head)}.*\n\|---.*\n((?:\|.*\n)+)", PAGE, re.MULTILINE):
        for row in table.splitlines():
            first, rest = row.strip("|").split("|", 1)
            for name in re.findall(r"`(\w+)`", first):
                found[name] = rest
    return found


@pytest.mark.parametrize("message", MESSAGES, ids=lambda message: message.__name__)
def test_the_page_has_each_message_with_its_fields(message: Any) -> None:
    kind = message.__struct_config__.tag
    fields = set(message.__struct_fields__)
    if message is Hello:
        (row,) = re.findall(r"answer with `hello`: (.*?)\n6\.", PAGE, re.DOTALL)
    else:
        row = rows("| `kind` | fields")[kind]
    if message in (Welcome, Observation):
        assert set(rows(f"| field of `{kind}`")) == fields
    else:
        assert fields <= set(re.findall(r"`(\w+)`", row))


def test_the_page_has_the_numbers_of_the_wire() -> None:
    assert f"`version` ({VERSION})" in PAGE
    assert f"| size of a client's message | {MAX_CLIENT_MESSAGE // 1024} KiB |" in PAGE
    listed = rows("| `kind` | fields")["recordings"]
    assert set(EpisodeSummary.__struct_fields__) <= set(re.findall(r"`(\w+)`", listed))
