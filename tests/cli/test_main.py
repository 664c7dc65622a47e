"""Behaviour common to all commands: encoding, rendering backends, Ctrl-C."""

from __future__ import annotations

import io
import os
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
from rich.console import Console

from shapechanger.cli.console import StudyProgress
from tests.cli.running import Cli
from tests.drawing import run_python

RENDER = ["envs", "Ant", "--picture", "ant.png"]
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
def test_ctrl_c_while_loading_prints_one_word(name: str) -> None:
    code = INTERRUPTED.format(name=name) + COMMAND.format(arguments=["envs", "Ant"])
    done = run_python(code)
    assert done.returncode == 130
    assert done.stderr == "Stopped.\n"


@pytest.mark.system
def test_ascii_output_replaces_missing_letters() -> None:
    arguments = ["envs", "InvertedPendulum"]
    done = run_python(COMMAND.format(arguments=arguments), PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    assert "hinge/velocity" in done.stdout
    assert done.stdout.isascii()
    done = run_python(COMMAND.format(arguments=["envs", "Ä"]), PYTHONIOENCODING="ascii")
    assert done.stderr.startswith("error: No environment matches '?'")


@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="Other systems always have a display.")
@pytest.mark.parametrize(
    ("arguments", "variables", "message"),
    [
        (["envs", "Ant"], {"MUJOCO_GL": "nonsense"}, "one of egl, osmesa, glfw"),
        (RENDER, {"MUJOCO_GL": "disable"}, "cannot render with MUJOCO_GL=disable: set it to one"),
        (RENDER, {"DISPLAY": ":77"}, "GLFW opens no window on the display :77"),
    ],
)
def test_rendering_failures_give_one_sentence(
    arguments: list[str],
    variables: dict[str, str],
    message: str,
    tmp_path: os.PathLike[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    done = run_python(COMMAND.format(arguments=arguments), **variables)
    assert done.returncode == 2, done.stderr
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1
    assert message in done.stderr
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
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="This system has no /dev/full.")
def test_a_full_disk_behind_the_output_is_one_sentence() -> None:
    """There is no traceback, neither on write nor at the exit of the interpreter."""
    code = COMMAND.format(arguments=["robot", "check", "car", "--wiring", "--port", "0"])
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-c", code], stdout=full, stderr=subprocess.PIPE, text=True
        )
    assert done.returncode == 2
    assert done.stderr == "error: Not everything could be printed: No space left on device.\n"


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("train Ant --learner ppo-rum", "Did you mean 'ppo-run'?"),
        ("train Ant --steps 10", "A budget of 10 steps is too small"),
        ("transfer Ant ExtendedAnt --rule foot_1", "NAME=RULE"),
        ("transfer Ant ExtendedAnt --map none.toml", "No body map matches 'none.toml'"),
        ("transfer Ant BigAnt --workers 0", "at least one worker"),
        ("transfer Ant BigAnt --arms scratch identified", "can adapt the source"),
        ("train Ant --set learning_rate", "NAME=VALUE"),
        ("train Ant --set \"n_envs='a'\"", "n_envs"),
        ("train Ant --set gamma=0.9 gamma=0.8", "more than once"),
        ("train Ant --learner cloning", "Ant-v1 has no camera, and"),
        ("transfer Finger Finger --target-options '{'", "must be JSON"),
        ("play Ant --policy none.safetensors", "There is no policy file none.safetensors"),
        ("play Ant --policy referense", "did you mean reference?"),
        ("play Ant --episodes 0", "must be at least 1"),
        ("train Ant --seed -1", "A seed must be a whole number from 0"),
        ("transfer Ant BigAnt --map m --rule a=b", "leave out --rule"),
        ("transfer Ant BigAnt --arms scratch fine-tune fine-tune", "fine-tune more than once"),
        ("train Car --tensorboard logs", "leave out --tensorboard"),
        ("train Ant --out .", "Cannot write .: it is a folder"),
        ("play Ant --out film.txt", "a film ends with one of .avi"),
        ("envs BigAmt", "No environment matches 'BigAmt'. Did you mean 'BigAnt'?"),
        ("envs Ant --body '[{'", "must be a JSON list of edits"),
        ("envs CartPole-v1 Ant", "CartPole-v1 offers no certify_shift"),
        ("envs CartPole-v1 --picture x.png", "CartPole-v1 offers no picture"),
        ("envs CartPole-v1", "publishes no observation_layout"),
        ("envs CartPole-v1 --body Ant", "CartPole-v1 takes no body"),
        ("envs Ant --picture x.png --width -5", "1 to 8192 pixels"),
        ("polices", "No command of `shapechanger` matches 'polices'. Did you mean 'policies'?"),
        ("policies shw", "`shapechanger policies` matches 'shw'. Did you mean 'show'?"),
        ("train Car --teacher", "--teacher needs a value after it"),
        ("train Car --teachr x", "matches '--teachr'. Did you mean '--teacher'?"),
        ("demos edit cut x --frm 4", "Did you mean '--from'?"),
        ("robot camera --profile x", "No option of `shapechanger robot camera` matches"),
        ("train Ant --bodies 3 --learner ppo-run", "ppo-run learns in one body. With --bodies"),
        ("train Ant --bodies 3 --body BigAnt", "--bodies must be above 0, and excludes --body"),
        ("train Car --bodies 3", "belongs to no family to draw from"),
        ("train HalfCheetah --bodies 70", "70 bodies need as many envs, and there are 64"),
        ("train Ant --bodies 3 --learner rsl-ppo --tensorboard logs", "no TensorBoard logs"),
        ("transfer Ant BigAnt --arms scratch generalist", "many bodies: give --learner limbs"),
        ("train Ant --tensorboard file", "Cannot write file"),
        ("train Ant --set gamma=0.9 --set n_epochs=5", "--set must be given once, with all"),
        ("robot serve car --policy a.onnx --policy=b.onnx", "--policy must be given once"),
    ],
)
def test_mistakes_give_one_sentence(
    command: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, cli: Cli
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").touch()
    assert message in " ".join(cli.refused(*shlex.split(command)).split())
    assert [path.name for path in tmp_path.rglob("*") if path.is_file()] == ["file"]


def test_a_terminal_shows_a_bar_with_the_time_left() -> None:
    screen = io.StringIO()
    console = Console(force_terminal=True, file=screen, width=120, legacy_windows=False)
    with StudyProgress({"scratch-0": 100, "scratch-1": 100}, console) as progress:
        progress("scratch-0", 50, False)
        progress("scratch-0", 100, True)
    shown = screen.getvalue()
    assert "1/2 runs" in shown
    assert "━" in shown
    assert "50 %" in shown
    assert "100/200" in shown
    assert "left:" in shown
    assert "\x1b" in shown


def test_without_a_terminal_progress_is_printed_as_lines() -> None:
    file = io.StringIO()
    with StudyProgress({"[/x]": 100, "b": 300}, Console(file=file, markup=False)) as progress:
        progress("[/x]", 100, True)
    assert file.getvalue().startswith("[/x] ended; 1/2 runs, 25 % of the steps")
    assert "\x1b" not in file.getvalue()
