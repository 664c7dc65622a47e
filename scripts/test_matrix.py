"""Run the fast tests against other versions and installations: `make test-matrix`.

Each lane has its own virtual environment under `build/matrix`:

- oldest: the lowest allowed version of every direct dependency;
- newest: the newest allowed versions, without constraints.txt;
- 3.11 to 3.14: the wheel without the sources, on each of these Pythons that this machine has;
- robot: the `[robot]` extra alone, like on a Raspberry Pi.

`python scripts/test_matrix.py oldest 3.12` runs two of them. The exit status is the worst's
lane. With `--release`, as in `make release`, the version must be the same everywhere, the changelog
complete, and `dist` holds the source distribution and the wheel that were tested.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
BUILD: Final = ROOT / "build" / "matrix"
CONSTRAINTS: Final = ROOT / "constraints.txt"
DIST: Final = ROOT / "dist"
PYTHONS: Final = ("3.11", "3.12", "3.13", "3.14")
LANES: Final = ("oldest", "newest", *PYTHONS, "robot")
FAST: Final = "not slow and not system"


def main() -> int:
    """Run the chosen lanes and report each on a line."""
    parser = argparse.ArgumentParser(description="Test other versions and installations.")
    parser.add_argument("lanes", nargs="*", default=LANES, help=f"some of {', '.join(LANES)}")
    parser.add_argument("--release", action="store_true", help="check what a release needs first")
    arguments = parser.parse_args()
    unknown = [lane for lane in arguments.lanes if lane not in LANES]
    if unknown:
        parser.error(f"no lane {unknown[0]!r}; lanes: {', '.join(LANES)}")
    if arguments.release and (reason := unreleasable()):
        parser.error(reason)
    built = build()
    results: dict[str, str] = {}
    for lane in arguments.lanes:
        if lane in PYTHONS and not has_python(lane):
            results[lane] = "skipped: this machine has no such Python"
            continue
        status = run_lane(lane, next(file for file in built if file.suffix == ".whl"))
        results[lane] = "passed" if status == 0 else f"failed with {status}"
    for lane, result in results.items():
        sys.stdout.write(f"{lane}: {result}\n")
    for file in built:
        digest = hashlib.sha256(file.read_bytes()).hexdigest()
        sys.stdout.write(f"{digest}  {file.relative_to(ROOT)}\n")
    return int(any(result.startswith("failed") for result in results.values()))


def unreleasable() -> str:
    """Return why this tree is no release; "" if it is one."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    version = project["version"]
    headings = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)
    if headings[0] != version:
        return (
            f"CHANGELOG.md begins with {headings[0]} and pyproject.toml has version {version}: "
            f"run `towncrier build --version {version}`"
        )
    if left := [file.name for file in (ROOT / "changelog.d").glob("*.*.md")]:
        return f"changelog.d still holds {left[0]}: run `towncrier build --version {version}`"
    citation = (ROOT / "CITATION.cff").read_text()
    if f"\nversion: {version}\n" not in citation:
        return f"CITATION.cff has another version than pyproject.toml, which has {version}"
    return ""


def build() -> tuple[Path, ...]:
    """Build the source distribution, and from it the wheel; return their files."""
    shutil.rmtree(DIST, ignore_errors=True)
    command = [sys.executable, "-m", "build", "--outdir", str(DIST), str(ROOT)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return tuple(sorted(DIST.iterdir()))


def has_python(version: str) -> bool:
    """Return whether uv finds a Python, without downloading one."""
    command = [sys.executable, "-m", "uv", "python", "find", "--no-python-downloads", version]
    return subprocess.run(command, check=False, capture_output=True).returncode == 0


def run_lane(lane: str, wheel: Path) -> int:
    """Install and test a lane, and return the exit status of the installation or of pytest."""
    if lane == "robot":  # This test makes its own environment.
        tests = [sys.executable, "-m", "pytest", "-q", "tests/claims/test_robot_install.py"]
        return subprocess.run(tests, cwd=ROOT, check=False).returncode
    is_wheel = lane in PYTHONS
    version = lane if is_wheel else f"{sys.version_info.major}.{sys.version_info.minor}"
    folder = BUILD / lane
    shutil.rmtree(folder, ignore_errors=True)
    options = {"oldest": ("--resolution", "lowest-direct"), "newest": ("--upgrade",)}.get(
        lane, ("-c", str(CONSTRAINTS))
    )
    what = (f"{wheel}[all,dev]",) if is_wheel else ("-e", f"{ROOT}[all,dev]")
    uv = [sys.executable, "-m", "uv"]
    venv = folder / "venv"
    made = ["venv", "--quiet", "--no-python-downloads", "--python", version, str(venv)]
    subprocess.run([*uv, *made], check=True)
    install = [*uv, "pip", "install", "--quiet", "--python", str(venv / "bin/python")]
    done = subprocess.run([*install, *options, *what], check=False)
    if done.returncode:
        return done.returncode
    # The tests run in a copy, so that the wheel cannot find the sources next to them.
    place, chosen = ROOT, FAST
    if is_wheel:
        chosen += " and not sources"
        place = folder / "checkout"
        left_out = ("src", "build", "dist", "site", ".venv*", ".git", "results", "__pycache__")
        left_out += (".lgd-nfy*",)  # A pipe of lgpio cannot be copied.
        shutil.copytree(ROOT, place, ignore=shutil.ignore_patterns(*left_out))
    environment = {name: v for name, v in os.environ.items() if name != "PYTHONPATH"}
    command = [str(venv / "bin/python"), "-m", "pytest", "-q", "-n", "2", "-m", chosen]
    return subprocess.run(command, cwd=place, env=environment, check=False).returncode


if __name__ == "__main__":
    raise SystemExit(main())
