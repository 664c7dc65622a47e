"""Docstrings of envs are pages: their tables equal the layouts, and no heading is missing."""

from __future__ import annotations

import inspect
import re
from itertools import groupby

import gymnasium as gym
import pytest

from shapechanger.contract.env_ref import layouts_of
from shapechanger.layout import Feature, Layout

IDS = (
    *("InvertedPendulum", "InvertedDoublePendulum", "Ant", "ExtendedAnt", "HalfCheetah"),
    *("Hopper", "Walker2d", "Swimmer", "Humanoid", "Car", "CarRanges", "CarWaypoint"),
    *("Finger", "FingerTrack"),
)
HEADINGS = (
    *("## Action space", "## Observation space", "## Reward", "## Start", "## End", "## Info"),
    *("Args:", "## Versions"),
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
        if (len(layout) == 1 and layout.size > 1) or name == "FingerTrack":
            continue  # An image; or FingerTrack, which shares the table of `Finger-v1`.
        lines = re.findall(rf"^\| Num +\| {title} .*\n(?:\|.*\n)*", f"{page}\n", re.MULTILINE)
        rows = [tuple(re.split(r" *\| *", line)[1:-1]) for line in lines[0].splitlines()[2:]]
        assert rows == layout_rows(layout, title)


def layout_rows(layout: Layout, title: str) -> list[tuple[str, ...]]:
    """Return a row per number; three or more observations of one kind share a row."""
    rows: list[tuple[str, ...]] = []
    first = 0
    for (kind, low, high, _), group in groupby(layout, _kind_of):
        features = list(group)
        is_block = title == "Observation" and len(features) > 2
        for few in [features] if is_block else [[feature] for feature in features]:
            size = sum(feature.size for feature in few)
            place = str(first) if size == 1 else f"{first}-{first + size - 1}"
            suffix = "/*" if few[0].name.count("/") > 1 else ""
            name = f"`*/{kind}{suffix}`" if is_block else f"`{few[0].name}`"
            rows.append((place, name, low, high, ", ".join(dict.fromkeys(f.unit for f in few))))
            first += size
    return rows


def _kind_of(feature: Feature) -> tuple[str, str, str, str]:
    """Return the name without the element, the bounds and the unit; the units of a block differ."""
    _, _, kind = feature.name.partition("/")
    kind, _, part = kind.partition("/")
    unit = "" if part else feature.unit
    return kind or feature.name, f"{feature.low:.4g}", f"{feature.high:.4g}", unit
