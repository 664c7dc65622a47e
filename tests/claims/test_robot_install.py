"""`pip install "shapechanger[robot]"` in a fresh environment."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from tests.drawing import missing
from tests.robot.twin.robots import until

ROOT: Final = Path(__file__).resolve().parents[2]
SPARED: Final = ("torch", "cv2", "mujoco", "matplotlib", "stable_baselines3", "ray", "pandas")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command in a fresh environment with the robot extra only."""
    folder = tmp_path_factory.mktemp("fresh") / "venv"
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True, timeout=120)
    install = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet"]
    install += ["--disable-pip-version-check", "-c", str(ROOT / "constraints.txt")]
    done = subprocess.run(
        [*install, f"{ROOT}[robot]"], check=False, capture_output=True, text=True, timeout=400
    )
    if done.returncode:
        missing(f"pip cannot install here: {done.stderr[-500:]}")
    return folder / "bin" / "shapechanger"


@pytest.fixture
def variables(tmp_path: Path) -> dict[str, str]:
    """Environment variables, without those of the present Python environment."""
    kept = {name: os.environ[name] for name in ("PATH", "HOME", "LANG") if name in os.environ}
    return kept | {"XDG_CONFIG_HOME": str(tmp_path)}


def test_heavy_packages_are_not_installed(
    program: Path, variables: dict[str, str], tmp_path: Path
) -> None:
    names = ", ".join(repr(name) for name in SPARED)
    code = f"import importlib.util as u; print([n for n in ({names},) if u.find_spec(n)])"
    found = subprocess.run(
        [str(program.parent / "python"), "-c", code],
        check=True,
        capture_output=True,
        text=True,
        env=variables,
        cwd=tmp_path,
    )
    assert found.stdout.strip() == "[]"


def test_check(program: Path, variables: dict[str, str], tmp_path: Path) -> None:
    """The check reports what is missing, and that packages are installed."""
    done = subprocess.run(
        [str(program), "robot", "check", "car", "--wiring"],
        check=False,
        capture_output=True,
        text=True,
        env=variables,
        cwd=tmp_path,
        timeout=60,
    )
    assert done.returncode == 1, done.stderr
    assert "packages: gpiozero is installed" in done.stdout
    assert done.stderr == ""


def test_serving_a_twin(program: Path, variables: dict[str, str], tmp_path: Path) -> None:
    """A twin starts, listens, and stops on SIGTERM."""
    ready = tmp_path / "ready.json"
    command = [str(program), "robot", "serve", "car", "--twin", "--port", "0", "--no-announce"]
    command += ["--world", "room"]
    with (tmp_path / "log.txt").open("wb") as log:
        served = subprocess.Popen(
            [*command, "--ready-file", str(ready)],
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            env=variables,
            cwd=tmp_path,
        )
    try:
        until(lambda: ready.exists() or served.poll() is not None, 60.0)
        assert ready.exists(), (tmp_path / "log.txt").read_text()
        assert json.loads(ready.read_text())["port"] > 0
    finally:
        if served.poll() is None:
            served.send_signal(signal.SIGTERM)
        assert served.wait(20.0) == 0
