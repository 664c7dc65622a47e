"""Docstrings of envs are pages: their tables equal the layouts, and no heading is missing."""

from __future__ import annotations

import inspect
from itertools import groupby

import gymnasium as gym
import pytest

import shapechanger  # noqa: F401  It registers the envs.
from shapechanger.contract.env_ref import layouts_of
from shapechanger.layout import Feature, Layout

IDS = (
    *("InvertedPendulum", "InvertedDoublePendulum", "Ant", "ExtendedAnt", "HalfCheetah"),
    *("Hopper", "Walker2d", "Swimmer", "Humanoid", "Car", "CarRanges", "CarWaypoint"),
)
HEADINGS = (
    *("## Action space", "## Observation space", "## Reward", "## Start", "## End", "## Info"),
    *("Args:", "## Versions"),
)
FEWEST = 3  # Features of one kind that become one row.


def kind_of(feature: Feature) -> tuple[str, str, str, str]:
    """Return the name without the element, the bounds and the unit; the units of a block differ."""
    _, _, kind = feature.name.partition("/")
    kind, _, part = kind.partition("/")
    unit = "" if part else feature.unit
    return kind or feature.name, f"{feature.low:.4g}", f"{feature.high:.4g}", unit


def table_of(layout: Layout, title: str) -> str:
    """Return the rows of a layout; consecutive observations of one kind share a row."""
    rows = [("Num", title, "Min", "Max", "Unit")]
    first = 0
    for (kind, low, high, _), group in groupby(layout, kind_of):
        features = list(group)
        is_block = title == "Observation" and len(features) >= FEWEST
        for few in [features] if is_block else [[feature] for feature in features]:
            size = sum(feature.size for feature in few)
            place = str(first) if size == 1 else f"{first}-{first + size - 1}"
            suffix = "/*" if few[0].name.count("/") > 1 else ""
            name = f"*/{kind}{suffix}" if is_block else few[0].name
            rows.append((place, name, low, high, ", ".join(dict.fromkeys(f.unit for f in few))))
            first += size
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    rows.insert(1, tuple("-" * width for width in widths))
    return "\n".join(
        f"| {' | '.join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))} |"
        for row in rows
    )


@pytest.mark.parametrize("name", IDS)
def test_a_docstring_is_a_page_of_the_env(name: str) -> None:
    with gym.make(f"shapechanger/{name}-v1") as env:
        page = inspect.getdoc(type(env.unwrapped)) or ""
        observation, action = layouts_of(env)
    missing = [heading for heading in HEADINGS if heading not in page]
    assert not missing
    steps = gym.spec(f"shapechanger/{name}-v1").max_episode_steps
    assert name == "ExtendedAnt" or f"runcated after {steps:,} steps" in page.replace("\n", " ")
    for layout, title in ((action, "Action"), (observation, "Observation")):
        assert layout is not None
        if len(layout) == 1 and layout.size > 1:
            continue  # An image.
        table = table_of(layout, title)
        assert table in page, f"The table of {title.lower()}s must be:\n{table}"
