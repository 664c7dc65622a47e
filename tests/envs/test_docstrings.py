"""Docstrings of envs are pages: they have the layouts' tables, all headings and all arguments."""

from __future__ import annotations

import importlib
import inspect
import re
from itertools import groupby
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

from shapechanger.contract.env_ref import layouts_of
from shapechanger.envs.reshapable import Reshapable
from shapechanger.layout import Feature, Layout
from shapechanger.robot.profile.load import find_profile, load_profile

IDS = (
    *("InvertedPendulum", "InvertedDoublePendulum", "Ant", "ExtendedAnt", "HalfCheetah"),
    *("Hopper", "Walker2d", "Swimmer", "Humanoid", "Car", "CarRanges", "CarWaypoint"),
    *("Finger", "FingerTrack", "OwnRobot"),
    *("RemoteFinger", "RemoteFingerTrack", "RemoteVehicle", "RemoteWaypoint"),
)
HEADINGS = ("Action space", "Observation space", "Reward", "Start", "End", "Info", "Versions")
OWN_BODIES = Path(__file__).parents[2] / "docs" / "own-bodies.md"
# Arguments that an env sets itself, and those that it passes to the env of a robot.
FIXED = {"self", "model_path", "observation_space", "has_camera", "coarse", "task"}
OF_A_RIG = ("key", "fingerprint", "on_reset", "on_waiting", "reset_timeout_s")
OF_WAYPOINTS = ("pace", "reward", "timeout_s", "interventions", "role", "name", "render_mode")


@pytest.mark.parametrize("name", IDS)
def test_a_docstring_is_a_page_of_the_env(name: str, tmp_path: Path) -> None:
    spec = gym.spec(f"shapechanger/{name}-v1")
    module, _, class_name = str(spec.entry_point).partition(":")
    env_class = getattr(importlib.import_module(module), class_name)
    page = inspect.getdoc(env_class) or ""
    words, steps = " ".join(page.split()), spec.max_episode_steps
    needed = ["Args:", *(f"## {title} " for title in HEADINGS), *arguments_of(name, env_class)]
    needed += [f"runcated after {steps:,} steps"] if steps else []
    assert [one for one in needed if not re.search(one, words)] == []
    for title, layout in layouts_of_page(name, tmp_path).items():
        lines = re.findall(rf"^\| Num +\| {title} .*\n(?:\|.*\n)*", f"{page}\n", re.MULTILINE)
        rows = [tuple(re.split(r" *\| *", line)[1:-1]) for line in lines[0].splitlines()[2:]]
        assert rows == layout_rows(layout, title)


def layouts_of_page(name: str, folder: Path) -> dict[str, Layout]:
    """Return the layouts of an env, or of the example that the page of a user's robot names."""
    given: dict[str, Any] = {"image": False} if name == "Car" else {}
    if name == "RemoteVehicle":
        car = load_profile(find_profile("car"))
        return {"Observation": car.state_layout(), "Action": car.action_layout()}
    if name == "OwnRobot":
        given["path"] = folder / "dog.xml"
        given["path"].write_text(OWN_BODIES.read_text().split('"""')[1])
    simulated = {"RemoteWaypoint": "CarWaypoint"}.get(name, name.removeprefix("Remote"))
    env = gym.make(f"shapechanger/{simulated}-v1", **given)
    env.close()
    return dict(zip(("Observation", "Action"), layouts_of(env), strict=True))


def arguments_of(name: str, env_class: type[Any]) -> list[str]:
    """Return a pattern per argument: a key of Args, or a name, Gymnasium's with its default."""
    found = dict.fromkeys(OF_A_RIG if name.startswith("RemoteFinger") else (), "")
    if name == "RemoteWaypoint":
        found = dict.fromkeys(OF_A_RIG + OF_WAYPOINTS, "")
    if issubclass(env_class, Reshapable):
        found = {"default_camera_config": "", "shadows": "None", "fast_model": "True"}
        found |= {"towards": "None"}
    fixed = {*FIXED, *(("parameters", "gap") if name.startswith("RemoteFinger") else ())}
    for base in env_class.__mro__:
        is_gymnasiums = base.__module__.startswith("gymnasium.envs")
        if "__init__" in vars(base) and (is_gymnasiums or base.__module__.startswith("shapech")):
            for one in inspect.signature(base.__init__).parameters.values():
                if one.kind is not one.VAR_KEYWORD and one.name not in fixed:
                    default = re.sub(r"\.0\b", "", repr(one.default).strip("()").replace("'", '"'))
                    found.setdefault(one.name, default if is_gymnasiums else "")
    return [
        rf"`{one}` \({re.escape(default)}\)" if default else f"`{one}`| {one}: "
        for one, default in found.items()
    ]


def layout_rows(layout: Layout, title: str) -> list[tuple[str, ...]]:
    """Return a row per number; axes, and three or more observations of one kind, share a row."""
    rows: list[tuple[str, ...]] = []
    first = 0
    for (kind, low, high, _), group in groupby(layout, _kind_of):
        features = list(group)
        is_block = title == "Observation" and len(features) > 2
        for few in [features] if is_block else [[feature] for feature in features]:
            size = sum(feature.size for feature in few)
            place = str(first) if size == 1 else f"{first}-{first + size - 1}"
            of_body, _, axis = few[-1].name.rpartition("/")
            name = f"`*/{kind}{'/*' if '/' in of_body else ''}`"
            if not is_block or "/" in kind:
                name = f"`{few[0].name}`" + (f" to `{axis}`" if is_block else "")
            rows.append((place, name, low, high, ", ".join(dict.fromkeys(f.unit for f in few))))
            first += size
    return rows


def _kind_of(feature: Feature) -> tuple[str, str, str, str]:
    """Return the name, only axes with their element, bounds and unit; units of a block differ."""
    element, _, kind = feature.name.partition("/")
    kind, _, part = kind.partition("/")
    unit = "" if part else feature.unit
    kind = re.sub(r"^([vwqd]?)[wxyz]$", rf"{element}/\1", kind)
    return kind or feature.name, f"{feature.low:.4g}", f"{feature.high:.4g}", unit
