"""Docstrings of envs are pages: their tables equal the layouts, and no heading is missing."""

from __future__ import annotations

import inspect
import re

import gymnasium as gym
import pytest

from scripts.site_pages import layout_rows
from shapechanger.contract.env_ref import layouts_of

IDS = (
    *("InvertedPendulum", "InvertedDoublePendulum", "Ant", "HalfCheetah"),
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
    assert f"runcated after {steps:,} steps" in page.replace("\n", " ")
    for layout, title in ((action, "Action"), (observation, "Observation")):
        assert layout is not None
        if (len(layout) == 1 and layout.size > 1) or name == "FingerTrack":
            continue  # An image; or FingerTrack, which shares the table of `Finger-v1`.
        lines = re.findall(rf"^\| Num +\| {title} .*\n(?:\|.*\n)*", f"{page}\n", re.MULTILINE)
        rows = [tuple(re.split(r" *\| *", line)[1:-1]) for line in lines[0].splitlines()[2:]]
        assert rows == layout_rows(layout, title)
