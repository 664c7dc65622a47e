"""`shapechanger envs`."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium as gym
import imageio.v3 as iio
import numpy as np
import pytest

from shapechanger.envs import CATALOGUE
from shapechanger.envs.catalogue import ODRL_ENVS, VEHICLE_ENVS
from shapechanger.layout import Element, Feature, Layout
from tests.cli.running import Cli
from tests.envs.own_robots import DOG


def test_without_an_env_all_bodies_and_vehicles_are_listed(cli: Cli) -> None:
    text = cli.output("envs")
    assert all(env_id in text for env_id in (*CATALOGUE, *VEHICLE_ENVS))


def test_an_env_is_shown_with_its_layout_as_a_table(cli: Cli) -> None:
    text = cli.output("envs", "BigInvertedPendulum")
    for word in ("hinge/velocity", "rad/s", "-1.571", "joint slider", "100 N", "slide/motor"):
        assert word in text
    text = cli.output("envs", "Ant", "--body", "BigAnt")
    assert "standing height: 0.9467 m" in text


def test_two_envs_are_compared_by_their_certificate(cli: Cli) -> None:
    text = cli.output("envs", "Ant", "AmputatedAnt")
    assert "shank_4: length 0.5657 m -> 0.1414 m (x0.25)" in text


def test_check_lists_each_promise(cli: Cli) -> None:
    assert cli.output("envs", "SmallInvertedPendulum", "--check").count("kept") == 7


@pytest.mark.gl
def test_picture_writes_an_image(cli: Cli, tmp_path: Path) -> None:
    out = tmp_path / "new" / "ant.png"
    cli.output("envs", "Ant", "--picture", str(out), "--width", "160", "--height", "120")
    assert iio.imread(out).shape == (120, 160, 3)


class Bracketed(gym.Env[np.ndarray, np.ndarray]):
    """An env whose names look like Rich markup and emoji."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    action_space = gym.spaces.Box(-1.0, 1.0, (1,))
    observation_layout = Layout([Feature("[/x]", "m", element=Element("body", "a/b[c]"))])
    action_layout = Layout([Feature("[red]a", ":ant:", -1.0, 1.0)])
    body = ("[/y]",)


def test_names_are_printed_as_they_are(cli: Cli) -> None:
    gym.register("Bracketed-v0", Bracketed, disable_env_checker=True)
    try:
        text = cli.output("envs", "Bracketed-v0")
    finally:
        del gym.registry["Bracketed-v0"]
    for name in ("[/x]", "body a/b[c]", "[red]a", ":ant:", "body: [/y]"):
        assert name in text


def test_the_bodies_of_odrl_are_one_row(cli: Cli) -> None:
    text = cli.output("envs")
    assert "80 targets of ODRL" in text
    assert "odrl-hopper-friction-0.1" not in text
    text = cli.output("envs", "--odrl")
    assert all(env_id in text for env_id in ODRL_ENVS)


def test_bodies_of_odrl_have_short_names(cli: Cli) -> None:
    """Names have a slash or a hyphen; a body without a change (ODRL, issue 8) is refused."""
    text = cli.output("envs", "odrl/hopper", "odrl-hopper-friction-0.5")
    assert "floor + foot_geom: contact friction 2 each -> 1 each (x0.5)" in text
    names = ("odrl/hopper-friction-0.1", "odrl/hopper-friction-0.5")
    assert "nothing to transfer across" in cli.refused("envs", *names)
    assert "Did you mean 'odrl-ant-morph-alllegs-easy'" in cli.refused(
        "envs", "odrl/ant-morph-all-legs-easy"
    )


def test_a_file_is_an_env(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "dog.xml").write_text(DOG)
    (tmp_path / "tricks.py").write_text(
        "class Sit:\n    observe = ['back/angle']\n"
        "    def __init__(self, weight=1.0):\n        self.weight = weight\n"
        "    def reward(self, robot):\n        return {'sit': -self.weight * robot.height}\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert "back/target" in cli.output("envs", "dog.xml")
    text = cli.output("envs", "dog.xml@tricks:Sit")
    assert "observation: 1 numbers" in text
    options = '{"task_options": {"weight": 2.0}}'
    text = cli.output("envs", "dog.xml@tricks:Sit", "--check", "--options", options)
    assert "The reward is the sum of the terms" in text
    edit = '[{"edit":"stretch","body":"front","factor":1.5}]'
    text = cli.output("envs", "dog.xml", "dog.xml", "--other-body", edit)
    assert "dog behaves differently from dog" in text
    options = '{"frame_skip": 8}'
    compared = ("envs", "dog.xml", "dog.xml", "--other-options", options)
    assert "observations part" in cli.output(*compared)
    assert "Name an env" in cli.refused("envs", "--check")
    assert "need a second env" in cli.refused("envs", "Ant", "--other-body", "BigAnt")
    assert "Did you mean 'dog.xml'" in cli.refused("envs", "dgo.xml")
    assert "Did you mean 'walk'" in cli.refused("envs", "dog.xml@wlk")
