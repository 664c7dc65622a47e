"""Behaviour common to all commands: encoding, rendering backends, Ctrl-C."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from tests.drawing import run_python

COMMAND = "from shapechanger.cli import main; main({arguments!r})"
INTERRUPTED = """
import sys
class CtrlC:
    def find_spec(self, name, path=None, target=None):
        if name == {name!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, CtrlC())
"""


@pytest.mark.system
@pytest.mark.parametrize("name", ["tyro", "mujoco"])
def test_ctrl_c_while_loading_is_one_word(name: str) -> None:
    code = INTERRUPTED.format(name=name) + COMMAND.format(arguments=["envs", "show", "Ant"])
    done = run_python(code)
    assert done.returncode == 130
    assert done.stderr == "Stopped.\n"


@pytest.mark.system
def test_ascii_output_replaces_missing_letters() -> None:
    arguments = ["envs", "show", "InvertedPendulum"]
    done = run_python(COMMAND.format(arguments=arguments), PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert "hinge/velocity" in done.stdout
    assert done.stdout.isascii()
    message = run_python(
        COMMAND.format(arguments=["envs", "show", "Ä"]), PYTHONIOENCODING="ascii"
    ).stderr
    assert message.startswith("error: No environment matches '?'")


@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="Other systems always have a display.")
@pytest.mark.parametrize(
    ("arguments", "variables", "words"),
    [
        (["envs", "show", "Ant"], {"MUJOCO_GL": "nonsense"}, "one of egl, osmesa, glfw"),
        (
            ["envs", "render", "Ant", "--out", "ant.png"],
            {"MUJOCO_GL": "disable"},
            "MuJoCo cannot render with MUJOCO_GL=disable: set it to one of egl, osmesa, glfw",
        ),
        (
            ["envs", "render", "Ant", "--out", "ant.png"],
            {"DISPLAY": ":77"},
            "GLFW opens no window on the display :77",
        ),
    ],
)
def test_rendering_failures_give_one_sentence(
    arguments: list[str],
    variables: dict[str, str],
    words: str,
    tmp_path: os.PathLike[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run_python(COMMAND.format(arguments=arguments), **variables)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert words in done.stderr
    assert not os.listdir(tmp_path)


def test_a_missing_pygame_gives_one_sentence(tmp_path: os.PathLike[str]) -> None:
    """Gymnasium's classic control renders with pygame, which is not a dependency."""
    code = (
        "import sys; sys.modules['pygame'] = None\n"
        "from shapechanger.cli import main\n"
        f"main(['play', 'CartPole-v1', '--out', {str(tmp_path) + '/film.mp4'!r}])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.startswith("error: pygame is not installed")
    assert done.stderr.count("\n") == 1


@pytest.mark.system
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="Here no disk is always full.")
def test_a_full_disk_behind_the_output_is_one_sentence() -> None:
    """No traceback, neither on write nor at interpreter exit."""
    code = COMMAND.format(arguments=["robot", "check", "car", "--wiring", "--port", "0"])
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code],
            check=False,
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
        )
    assert done.returncode == 2
    assert done.stderr == "error: Not everything could be printed: No space left on device.\n"
