"""`shapechanger train`, `play` and `transfer` as a user runs them."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from shapechanger.cli import main

COMMAND = [sys.executable, "-c", "from shapechanger.cli import main; main()"]
QUICK = ["transfer", "InvertedPendulum", "BigInvertedPendulum", "--quick"]


def run(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    """A command in a process of its own."""
    return subprocess.run(  # type: ignore[call-overload]
        [*COMMAND, *arguments], capture_output=True, text=True, check=False, **options
    )


def curves(out: Path) -> dict[str, list[tuple[int, float]]]:
    """Every number of a study."""
    study = json.loads((out / "study.json").read_text())
    return {
        f"{r['run']['kind']}-{r['run']['index']}": [
            (e["steps"], e["mean_return"]) for e in r["curve"]
        ]
        for r in study["runs"]
    }


@pytest.fixture(scope="module")
def quick(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """A quick study that nobody disturbed: its folder, and what it printed."""
    out = tmp_path_factory.mktemp("quick") / "study"
    return out, run(*QUICK, "--out", str(out))


def test_a_study_is_one_command(
    quick: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """A table on the terminal, study.json, and a report that needs no other file."""
    out, done = quick
    assert done.returncode == 0, done.stderr
    assert "Jumpstart" in done.stdout
    assert "Counted in target steps" in done.stdout
    report = (out / "report.html").read_text()
    assert "pole: length 0.6 m" in report
    assert 'src="http' not in report
    study = json.loads((out / "study.json").read_text())
    assert "InvertedPendulum" in study["command"]
    assert study["versions"]["shapechanger"]


def test_progress_is_plain_lines_without_a_terminal(
    quick: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """One line for each run that ends, with the time left, and no control characters."""
    lines = quick[1].stderr.splitlines()
    assert sum(" ended; " in line for line in lines) == 10
    assert any("s left" in line for line in lines)
    assert "\x1b" not in quick[1].stderr


def _until(condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    """Wait until something has happened, or the process has ended."""
    end = time.monotonic() + 240.0
    while not condition():
        assert time.monotonic() < end, "waited too long"
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.01)
            pytest.fail(f"ended too early: {process.communicate()}")


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT])
def test_a_study_that_was_killed_goes_on_to_the_same_numbers(
    quick: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path, how: signal.Signals
) -> None:
    """Pull the plug while scratch learns: the same command ends with the same numbers."""
    out = tmp_path / "study"
    process = subprocess.Popen(
        [*COMMAND, *QUICK, "--out", str(out)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    half_way = out / "runs" / "scratch-0" / "curve.jsonl"
    _until(half_way.exists, process)
    # Ctrl-C reaches every process of the terminal; a kill only the one.
    (os.killpg if how == signal.SIGINT else os.kill)(process.pid, how)
    _, message = process.communicate()
    assert not (out / "runs" / "scratch-0" / "run.json").exists()
    if how == signal.SIGINT:
        assert process.returncode == 130
        assert "go on with: shapechanger transfer" in message
        assert "Traceback" not in message
    done = run(*QUICK, "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert "had ended before" in done.stdout
    assert curves(out) == curves(quick[0])


def test_a_disk_that_runs_full_is_one_sentence(tmp_path: Path) -> None:
    """Files may be no larger than 20 kB, and a policy is: what had ended is kept."""
    done = run(
        *QUICK,
        "--out",
        str(tmp_path / "study"),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)),
    )
    assert done.returncode == 2
    assert "Cannot write" in done.stderr
    assert "policy.zip" in done.stderr
    assert "go on with: shapechanger transfer" in done.stderr
    assert "Traceback" not in done.stderr


def test_a_policy_is_trained_played_and_brought_along(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Training writes what play and transfer take; TensorBoard gets its logs."""
    policy, film = str(tmp_path / "policy.zip"), tmp_path / "film.mp4"
    logs = tmp_path / "logs"
    main(
        [
            "train",
            "InvertedPendulum",
            "--steps",
            "3072",
            "--out",
            policy,
            "--tensorboard",
            str(logs),
        ]
    )
    assert "wrote" in capsys.readouterr().out
    assert list(logs.rglob("events.out.tfevents.*"))
    out = str(tmp_path / "study")
    arguments = ["--source-policy", policy, "--steps", "3072", "--seeds", "2", "--out", out]
    done = run("transfer", "InvertedPendulum", "BigInvertedPendulum", *arguments)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "study" / "runs" / "source-0").exists()
    assert not film.exists()


@pytest.mark.gl
def test_play_makes_a_film_where_there_is_no_screen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A film file, and what the episode was worth."""
    film = tmp_path / "ant.mp4"
    main(["play", "Ant", "--max-steps", "5", "--out", str(film)])
    assert film.stat().st_size > 0
    assert "episode 0: return" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["train", "Ant", "--learner", "ppo-rum"], "Did you mean 'ppo-run'?"),
        (["train", "Ant", "--steps", "10"], "smaller than one evaluation"),
        (["transfer", "Ant", "BigAnt", "--steps", "10"], "smaller than one evaluation"),
        (["transfer", "Ant", "BigAnt", "--seeds", "1"], "at least 2 seeds"),
        (["transfer", "Ant", "InvertedPendulum"], "cannot be mapped"),
        (["transfer", "Ant", "BigAmt"], "Did you mean 'BigAnt'?"),
        (["transfer", "Ant", "ExtendedAnt", "--rule", "foot_1"], "NAME=RULE"),
        (["transfer", "Ant", "ExtendedAnt", "--rule", "toot_1/motor=zero"], "Did you mean"),
        (["transfer", "Ant", "ExtendedAnt", "--map", "none.toml"], "cannot be read"),
        (["transfer", "Ant", "BigAnt", "--workers", "0"], "at least one worker"),
        (["play", "Ant", "--policy", "none.zip"], "There is no policy file none.zip"),
        (["play", "Ant", "--episodes", "0"], "at least one episode"),
    ],
)
def test_nonsense_gets_one_sentence(
    arguments: list[str],
    words: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Exit code 2, no traceback, and nothing is written."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main(arguments)
    message = capsys.readouterr().err
    assert stop.value.code == 2
    assert words in message
    assert message.count("\n") == 1
    assert not list(tmp_path.iterdir())


BLOCKED = """
import sys
class Blocked:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {names}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)
sys.meta_path.insert(0, Blocked())
from shapechanger.cli import main
main({arguments})
"""


@pytest.mark.parametrize(
    ("missing", "extra", "arguments"),
    [
        ("mujoco", "sim", ["envs", "show", "Ant"]),
        ("torch", "learn", ["train", "InvertedPendulum"]),
        ("stable_baselines3", "learn", ["train", "InvertedPendulum"]),
        ("tyro", "cli", ["envs", "list"]),
        ("rich", "cli", ["envs", "list"]),
        ("imageio", "sim", ["envs", "render", "Ant", "--out", "ant.png"]),
    ],
)
def test_a_missing_extra_is_named_with_its_command(
    missing: str, extra: str, arguments: list[str]
) -> None:
    """Which one, and what installs it; in one sentence."""
    code = BLOCKED.format(names={missing}, arguments=arguments)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert f"pip install 'shapechanger[{extra}]'" in done.stderr
    assert "Traceback" not in done.stderr
