"""`shapechanger envs`."""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium as gym
import imageio.v3 as iio
import numpy as np
import pytest

from shapechanger.cli import main
from shapechanger.envs import CATALOGUE
from shapechanger.envs.catalogue import ODRL_ENVS, VEHICLE_ENVS
from shapechanger.layout import Element, Feature, Layout
from tests.envs.own_robots import DOG


def output_of(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the standard output of a command."""
    main(arguments)
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the one-sentence error of a command."""
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    assert stop.value.code == 2
    message = capsys.readouterr().err
    assert "Traceback" not in message
    return message


def test_list_names_every_env(capsys: pytest.CaptureFixture[str]) -> None:
    text = output_of(capsys, "envs", "list")
    assert all(env_id in text for env_id in (*CATALOGUE, *VEHICLE_ENVS))


def test_show_prints_the_layout_as_a_table(capsys: pytest.CaptureFixture[str]) -> None:
    """Names, units, ranges, elements and gains."""
    text = output_of(capsys, "envs", "show", "BigInvertedPendulum")
    for word in ("hinge/velocity", "rad/s", "-1.571", "joint slider", "100 N", "slide/motor"):
        assert word in text
    text = output_of(capsys, "envs", "show", "Ant", "--body", "BigAnt")
    assert "standing height: 0.9467 m" in text


def test_compare_prints_the_certificate(capsys: pytest.CaptureFixture[str]) -> None:
    text = output_of(capsys, "envs", "compare", "Ant", "AmputatedAnt")
    assert "shank_4: length 0.5657 m -> 0.1414 m (x0.25)" in text


def test_compare_refuses_a_shift_that_changes_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    """A foot's friction below the floor's has no effect."""
    body = '[{"edit":"friction","element":"*ankle_geom","scale":0.2}]'
    message = refused(capsys, "envs", "compare", "Ant", "Ant", "--target-body", body)
    assert "nothing to transfer across" in message


def test_check_lists_each_promise(capsys: pytest.CaptureFixture[str]) -> None:
    assert output_of(capsys, "envs", "check", "SmallInvertedPendulum").count("kept") == 7


@pytest.mark.gl
def test_render_writes_an_image(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "new" / "ant.png"
    output_of(
        capsys, "envs", "render", "Ant", "--out", str(out), "--width", "160", "--height", "120"
    )
    assert iio.imread(out).shape == (120, 160, 3)


@pytest.mark.gl
def test_render_refuses_a_place_that_cannot_be_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    out = str(tmp_path / "file" / "ant.png")
    assert "Cannot write" in refused(capsys, "envs", "render", "Ant", "--out", out)


class Bracketed(gym.Env[np.ndarray, np.ndarray]):
    """An env whose names look like Rich markup and emoji."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    action_space = gym.spaces.Box(-1.0, 1.0, (1,))
    observation_layout = Layout(
        [Feature("[/x]", "m", -1.0, 1.0, element=Element("body", "a/b[c]"))],
    )
    action_layout = Layout([Feature("[red]a", ":ant:", -1.0, 1.0)])
    body = ("[/y]",)


def test_names_are_printed_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    gym.register("Bracketed-v0", Bracketed, disable_env_checker=True)
    try:
        text = output_of(capsys, "envs", "show", "Bracketed-v0")
    finally:
        del gym.registry["Bracketed-v0"]
    for name in ("[/x]", "body a/b[c]", "[red]a", ":ant:", "body: [/y]"):
        assert name in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("show", "BigAmt"), "No environment matches 'BigAmt'. Did you mean 'BigAnt'?"),
        (("show", "Ant", "--body", "BigAmt"), "Did you mean 'BigAnt'?"),
        (("show", "Ant", "--body", "[{"), "must be a JSON list of edits"),
        (
            ("show", "Ant", "--body", '[{"edit":"stretch","body":"shank_9","factor":2}]'),
            "No body matches 'shank_9'. Did you mean",
        ),
        (("compare", "Ant", "Cart"), "No environment matches 'Cart'"),
        (("compare", "CartPole-v1", "Ant"), "CartPole-v1 offers no certify_shift"),
        (("render", "CartPole-v1", "--out", "x.png"), "CartPole-v1 offers no picture"),
        (("show", "CartPole-v1"), "publishes no observation_layout"),
        (("show", "CartPole-v1", "--body", "Ant"), "CartPole-v1 takes no body"),
        (("show", "a:b:c"), "No environment matches 'a:b:c'"),
        (("show", ":"), "No environment matches ':'"),
        (("show", ".a:b"), "No environment matches '.a:b'"),
        (("render", "Ant", "--out", "x.png", "--width", "-5"), "1 to 8192 pixels"),
        (("render", "Ant", "--out", "x.png", "--width", "100000000"), "1 to 8192 pixels"),
    ],
)
def test_mistakes_give_one_sentence(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], words: str
) -> None:
    """The error suggests what exists; exit code 2, no traceback."""
    message = refused(capsys, "envs", *arguments)
    assert message.startswith("error: ")
    assert message.count("\n") == 1
    assert words in message


def test_an_unknown_command_lists_the_commands(capsys: pytest.CaptureFixture[str]) -> None:
    assert "compare" in refused(capsys, "envs", "shwo")
    assert "transfer" in refused(capsys, "trasnfer")


def test_the_bodies_of_odrl_are_one_row(capsys: pytest.CaptureFixture[str]) -> None:
    """Unless asked for: 84 ids would drown the others."""
    text = output_of(capsys, "envs", "list")
    assert "80 targets of ODRL" in text
    assert "odrl-hopper-friction-0.1" not in text
    text = output_of(capsys, "envs", "list", "--odrl")
    assert all(env_id in text for env_id in ODRL_ENVS)


def test_bodies_of_odrl_have_short_names(capsys: pytest.CaptureFixture[str]) -> None:
    """With a slash or a hyphen; issue 8 of ODRL is refused, and a typing mistake named."""
    text = output_of(capsys, "envs", "compare", "odrl/hopper", "odrl-hopper-friction-0.5")
    assert "floor + foot_geom: contact friction 2 each -> 1 each (x0.5)" in text
    names = ("odrl/hopper-friction-0.1", "odrl/hopper-friction-0.5")
    assert "nothing to transfer across" in refused(capsys, "envs", "compare", *names)
    assert "Did you mean 'odrl-ant-morph-alllegs-easy'" in refused(
        capsys, "envs", "show", "odrl/ant-morph-all-legs-easy"
    )


def test_a_file_is_an_env(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With the built-in task, a task of a module in its folder, a body, and options."""
    (tmp_path / "dog.xml").write_text(DOG)
    (tmp_path / "tricks.py").write_text(
        "class Sit:\n    observe = ['back/angle']\n"
        "    def __init__(self, weight=1.0):\n        self.weight = weight\n"
        "    def reward(self, robot):\n        return {'sit': -self.weight * robot.height}\n"
    )
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    assert "back/target" in output_of(capsys, "envs", "show", "dog.xml")
    text = output_of(capsys, "envs", "show", "dog.xml@tricks:Sit")
    assert "observation: 1 numbers" in text
    options = '{"task_options": {"weight": 2.0}}'
    text = output_of(capsys, "envs", "check", "dog.xml@tricks:Sit", "--options", options)
    assert "The reward is the sum of the terms" in text
    edit = '[{"edit":"stretch","body":"front","factor":1.5}]'
    text = output_of(capsys, "envs", "compare", "dog.xml", "dog.xml", "--target-body", edit)
    assert "dog behaves differently from dog" in text
    options = '{"frame_skip": 8}'
    compared = ("envs", "compare", "dog.xml", "dog.xml", "--target-options", options)
    assert "observations part" in output_of(capsys, *compared)
    assert "Did you mean 'dog.xml'" in refused(capsys, "envs", "show", "dgo.xml")
    assert "Did you mean 'walk'" in refused(capsys, "envs", "show", "dog.xml@wlk")
