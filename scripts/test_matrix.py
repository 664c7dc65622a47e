"""Run the fast tests against other versions and installations: `make test-matrix`.

Each lane has its own virtual environment under `build/matrix`:

- oldest: the lowest allowed version of every direct dependency;
- newest: the newest allowed versions, without constraints.txt;
- python: another Python that `uv` or the system provides, 3.13 unless `--python` names one;
- wheel: the built wheel, without the sources;
- robot: the `[robot]` extra alone, as on a Raspberry Pi.

`python scripts/test_matrix.py oldest wheel` runs two of them. The exit status is that of the worst
lane.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
BUILD: Final = ROOT / "build" / "matrix"
CONSTRAINTS: Final = ROOT / "constraints.txt"
LANES: Final = ("oldest", "newest", "python", "wheel", "robot")
FAST: Final = ("-q", "-n", "2", "-m", "not slow and not system")


def main() -> int:
    """Run the chosen lanes and report each on a line."""
    parser = argparse.ArgumentParser(description="Test other versions and installations.")
    parser.add_argument("lanes", nargs="*", default=LANES, help=f"some of {', '.join(LANES)}")
    parser.add_argument("--python", default="3.13", help="version for the lane `python`")
    arguments = parser.parse_args()
    unknown = [lane for lane in arguments.lanes if lane not in LANES]
    if unknown:
        parser.error(f"no lane {unknown[0]!r}; lanes: {', '.join(LANES)}")
    results = {lane: run_lane(lane, arguments.python) for lane in arguments.lanes}
    for lane, status in results.items():
        sys.stdout.write(f"{lane}: {'passed' if status == 0 else f'failed with {status}'}\n")
    return max(results.values())


def run_lane(lane: str, python: str) -> int:
    """Install and test one lane.

    Args:
        lane: Name of the lane.
        python: Python version of the lane `python`.

    Returns:
        The exit status of the installation or of pytest.
    """
    if lane == "robot":  # This test makes its own environment.
        tests = [sys.executable, "-m", "pytest", "-q", "tests/claims/test_robot_install.py"]
        return subprocess.run(tests, cwd=ROOT, check=False).returncode
    version = python if lane == "python" else f"{sys.version_info.major}.{sys.version_info.minor}"
    folder = BUILD / lane
    shutil.rmtree(folder, ignore_errors=True)
    target = f"{ROOT}[all,dev]"
    options = {
        "oldest": ("--resolution", "lowest-direct"),
        "newest": ("--upgrade",),
        "python": ("-c", str(CONSTRAINTS)),
        "wheel": ("-c", str(CONSTRAINTS)),
    }[lane]
    if lane == "wheel":
        dist = folder / "dist"
        build = [sys.executable, "-m", "build", "--wheel", "--outdir", str(dist), str(ROOT)]
        subprocess.run(build, check=True)
        target = f"{next(dist.glob('*.whl'))}[all,dev]"
    uv = [sys.executable, "-m", "uv"]
    venv = folder / "venv"
    subprocess.run([*uv, "venv", "--quiet", "--python", version, str(venv)], check=True)
    install = [*uv, "pip", "install", "--quiet", "--python", str(venv / "bin/python")]
    editable = () if lane == "wheel" else ("-e",)
    done = subprocess.run([*install, *options, *editable, target], check=False)
    if done.returncode:
        return done.returncode
    # The tests run in a copy, so that the wheel cannot find the sources beside them.
    place = ROOT
    if lane == "wheel":
        place = folder / "checkout"
        skip = shutil.ignore_patterns("src", "build", ".venv", ".git", "results", "__pycache__")
        shutil.copytree(ROOT, place, ignore=skip)
    environment = {name: v for name, v in os.environ.items() if name != "PYTHONPATH"}
    command = [str(venv / "bin/python"), "-m", "pytest", *FAST]
    return subprocess.run(command, cwd=place, env=environment, check=False).returncode


if __name__ == "__main__":
    raise SystemExit(main())
