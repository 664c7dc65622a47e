"""Run the fast tests against other versions and installations: `make test-matrix`.

Each lane has its own virtual environment, under `build/matrix` except for the lane `robot`:

- oldest: the lowest allowed version of every direct dependency;
- newest: the newest allowed versions, without constraints.txt;
- 3.11 to 3.14: the wheel without the sources, on each of these Pythons that this machine has;
- robot: only the `[robot]` extra, as on a Raspberry Pi.

`python scripts/test_matrix.py oldest 3.12` runs two lanes. Afterwards `dist` contains the source
distribution and the wheel that were tested.
"""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
DIST: Final = ROOT / "dist"
PYTHONS: Final = ("3.11", "3.12", "3.13", "3.14")
LANES: Final = ("oldest", "newest", *PYTHONS, "robot")
UV: Final = (sys.executable, "-m", "uv")


def main() -> int:
    """Run the chosen lanes and report each on a line; the exit status is 1 if one failed."""
    lanes = sys.argv[1:] or LANES
    if unknown := sorted({*lanes} - {*LANES}):
        raise SystemExit(f"There is no lane {unknown[0]!r}; lanes: {', '.join(LANES)}.")
    shutil.rmtree(DIST, ignore_errors=True)
    build = [sys.executable, "-m", "build", "--outdir", str(DIST), str(ROOT)]
    subprocess.run(build, check=True, stdout=subprocess.DEVNULL)
    results = {lane: run_lane(lane, next(DIST.glob("*.whl"))) for lane in lanes}
    print(*(f"{lane}: {result}" for lane, result in results.items()), sep="\n")
    return int(any(result.startswith("failed") for result in results.values()))


def run_lane(lane: str, wheel: Path) -> str:
    """Install and test a lane, and return its result."""
    if lane == "robot":  # This test makes its own environment.
        return _run(sys.executable, "-m", "pytest", "-q", "tests/claims/test_robot_install.py")
    is_wheel = lane in PYTHONS
    version = lane if is_wheel else f"{sys.version_info.major}.{sys.version_info.minor}"
    find = [*UV, "python", "find", "--no-python-downloads", version]
    if subprocess.run(find, check=False, capture_output=True).returncode:
        return "skipped: this machine has no such Python"
    folder = ROOT / "build" / "matrix" / lane
    shutil.rmtree(folder, ignore_errors=True)
    _run(*UV, "venv", "--quiet", "--no-python-downloads", "--python", version, f"{folder}/venv")
    python = f"{folder}/venv/bin/python"
    options = {"oldest": ("--resolution", "lowest-direct"), "newest": ("--upgrade",)}.get(
        lane, ("-c", f"{ROOT}/constraints.txt")
    )
    package = (f"{wheel}[all,dev]",) if is_wheel else ("-e", f"{ROOT}[all,dev]")
    installed = _run(*UV, "pip", "install", "--quiet", "--python", python, *options, *package)
    if installed != "passed":
        return installed
    place, chosen = ROOT, "not slow and not system"
    if is_wheel:  # In a copy without `src`, tests can import only the wheel.
        place, chosen = folder / "checkout", f"{chosen} and not sources"
        left_out = ("src", "build", "dist", "site", ".venv*", ".git", "results", "__pycache__")
        left_out += (".lgd-nfy*",)  # A pipe of lgpio cannot be copied.
        shutil.copytree(ROOT, place, ignore=shutil.ignore_patterns(*left_out))
    return _run(python, "-m", "pytest", "-q", "-n", "2", "-m", chosen, cwd=place)


def _run(*command: str, cwd: Path = ROOT) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    status = subprocess.run(command, cwd=cwd, env=environment, check=False).returncode
    return f"failed with {status}" if status else "passed"


if __name__ == "__main__":
    raise SystemExit(main())
