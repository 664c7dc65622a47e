"""`shapechanger train`, `play` and `transfer`."""

from __future__ import annotations

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from shapechanger.policy import load_policy
from tests.cli.running import Cli
from tests.envs.own_robots import DOG

pytestmark = pytest.mark.system

COMMAND = [sys.executable, "-c", "from shapechanger.cli import main; main()"]
QUICK = ["transfer", "InvertedPendulum", "BigInvertedPendulum", "--quick"]


def run(*arguments: str, **options: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(  # type: ignore[call-overload]
        [*COMMAND, *arguments], capture_output=True, text=True, check=False, **options
    )


def curves(out: Path) -> dict[str, list[tuple[int, float]]]:
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
    out = tmp_path_factory.mktemp("quick") / "study"
    return out, run(*QUICK, "--out", str(out))


def test_a_study_is_one_command(quick: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    out, done = quick
    assert done.returncode == 0, done.stderr
    assert "Jumpstart" in done.stdout
    assert "A verdict needs at least 3 seeds: run the same study again" in done.stdout
    report = (out / "report.html").read_text()
    assert "pole: length 0.6 m" in report
    assert 'src="http' not in report
    study = json.loads((out / "study.json").read_text())
    assert "InvertedPendulum" in study["command"]
    assert study["plan"]["versions"]["shapechanger"]
    assert sum(" ended; " in line for line in done.stderr.splitlines()) == 11
    assert "\x1b" not in done.stderr


def _until(condition: Callable[[], bool], process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + 240.0
    while not condition():
        assert time.monotonic() < end, "waited too long"
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(0.01)
            pytest.fail(f"ended too early: {process.communicate()}")


def test_a_killed_study_resumes_to_the_same_numbers(
    quick: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    out = tmp_path / "study"
    for how, run_name in ((signal.SIGINT, "scratch-0"), (signal.SIGKILL, "fine-tune-0")):
        process = subprocess.Popen(
            [*COMMAND, *QUICK, "--out", str(out)],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        _until((out / "runs" / run_name / "curve.jsonl").exists, process)
        # Ctrl-C reaches every process of the terminal, but a kill reaches only one.
        (os.killpg if how == signal.SIGINT else os.kill)(process.pid, how)
        _, message = process.communicate()
        assert not (out / "study.json").exists()
        if how == signal.SIGINT:
            assert process.returncode == 130
            assert "go on with: shapechanger transfer" in message
            assert "Traceback" not in message
    done = run(*QUICK, "--out", str(out))
    assert done.returncode == 0, done.stderr
    assert "had ended before" in done.stdout
    assert curves(out) == curves(quick[0])


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    policy = tmp_path_factory.mktemp("trained") / "policy.safetensors"
    logs = policy.with_name("logs")
    files = ["--out", str(policy), "--tensorboard", str(logs)]
    done = run("train", "InvertedPendulum", "--steps", "3072", *files)
    assert done.returncode == 0, done.stderr
    return policy, done.stdout


def test_training_writes_a_policy_and_logs(trained: tuple[Path, str]) -> None:
    policy, text = trained
    assert f"wrote {policy}" in text
    assert "train InvertedPendulum --steps 3072" in load_policy(policy).card.command
    assert list(policy.with_name("logs").rglob("events.out.tfevents.*"))


@pytest.mark.gl
def test_a_policy_is_played_in_its_body_and_in_another(
    trained: tuple[Path, str], tmp_path: Path, cli: Cli
) -> None:
    film = tmp_path / "film.mp4"
    policy = ("--policy", trained[0])
    for words in (("InvertedPendulum", *policy), ("BigInvertedPendulum", *policy), ("Ant",)):
        printed = cli.output("play", *words, "--max-steps", "5", "--out", film)
        assert "episode 0: return" in printed
        assert film.stat().st_size > 0
        film.unlink()


def test_another_study_or_a_file_instead_of_the_folder_is_refused(
    quick: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    done = run(*QUICK, "--seed", "1", "--out", str(quick[0]))
    assert done.returncode == 2
    assert "holds another study" in done.stderr
    assert "had ended" not in done.stdout + done.stderr
    done = run(*QUICK, "--out", str(quick[0] / "study.json"))
    assert done.returncode == 2
    assert done.stderr.count("error: Cannot write") == 1


def test_a_users_robot_and_task_are_studied(tmp_path: Path) -> None:
    """Worker processes use files and a module of the current folder, for two bodies."""
    (tmp_path / "dog.xml").write_text(DOG)
    (tmp_path / "tricks.py").write_text(
        "class Rise:\n    def reward(self, robot):\n        return {'height': robot.height}\n"
    )
    longer = '[{"edit":"stretch","body":"front","factor":1.3}]'
    small = ("n_steps=64", "n_envs=1", "batch_size=64", "eval_every=64", "eval_episodes=1")
    budget = ("--seeds", "2", "--steps", "128", "--source-steps", "64", "--set", *small)
    done = run(
        *("transfer", "dog.xml@tricks:Rise", "dog.xml@tricks:Rise", "--target-body", longer),
        *(*budget, "--arms", "scratch", "evolution"),
        cwd=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    study = json.loads((tmp_path / "results" / "dog-Rise-to-dog-Rise" / "study.json").read_text())
    source = study["plan"]["task"]["source"]
    assert source["kwargs"] == {"path": "dog.xml", "task": "tricks:Rise"}
    assert "reward_height" in json.dumps(study)
