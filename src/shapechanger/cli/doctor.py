"""The command `shapechanger doctor`: check the installation, and suggest repairs."""

from __future__ import annotations

import importlib.metadata
import os
import platform
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from shapechanger.cli.console import say
from shapechanger.errors import needing_extra
from shapechanger.robot.check.report import Finding, Results, run_checks, write_report

if TYPE_CHECKING:
    from packaging.requirements import Requirement

_PACKAGE: Final = "shapechanger"
# Extras that combine others, or are for developers of Shapechanger.
_NOT_LISTED: Final = ("all", "dev")
_PATIENCE_S: Final = 120  # Time limit of a check, s; rendering the first image is slow.
# Runs in a separate process, which a broken OpenGL driver may end.
_DRAW: Final = """
from shapechanger.envs.opengl import choose_gl
choose_gl()
import os, gymnasium, shapechanger
with gymnasium.make("shapechanger/InvertedPendulum-v1", render_mode="rgb_array") as env:
    env.reset(seed=0)
    height, width, _ = env.render().shape
print(f"{width} x {height} with {os.environ.get('MUJOCO_GL', 'glfw')}")
"""


@dataclass(frozen=True)
class Doctor:
    """Check the installation on this machine, and suggest repairs.

    `shapechanger robot check PROFILE` checks a robot.
    """

    def run(self) -> None:
        if not write_report([("machine", examine_machine())], say):
            sys.exit(1)


def examine_machine(
    requirements: Sequence[str] | None = None,
    version_of: Callable[[str], str] = importlib.metadata.version,
    dev: Path = Path("/dev"),
) -> Iterator[Finding]:
    """Check what Shapechanger can do on this machine."""
    if requirements is None:
        requirements = importlib.metadata.requires(_PACKAGE) or []
    with needing_extra("cli"):
        from packaging.requirements import Requirement
    parsed = [Requirement(text) for text in requirements]
    named = re.findall(r"""extra == ["'](.+?)["']""", " ".join(requirements))
    extras = sorted({*named} - {*_NOT_LISTED})

    def installed(package: str) -> str:
        try:
            return version_of(package)
        except importlib.metadata.PackageNotFoundError:
            return ""

    checks = [
        *(("machine", _machine()), ("core", _extra(parsed, "", installed))),
        *((f"extra {extra}", _extra(parsed, extra, installed)) for extra in extras),
        # If one of these packages is not installed, the check of its extra reports it.
        *([("images", _drawing())] if installed("mujoco") else []),
        *([("torch", _torch())] if installed("torch") else []),
        *([("warp", _warp())] if installed("warp-lang") else []),
        ("pins", _gpio(dev)),
    ]
    return run_checks(checks, _PATIENCE_S)


def _machine() -> Results:
    free_gb = shutil.disk_usage(Path.cwd()).free / 1e9
    yield (
        "good",
        f"shapechanger {importlib.metadata.version(_PACKAGE)}, Python {platform.python_version()}, "
        f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores, {free_gb:.0f} GB free.",
    )


def _extra(parsed: Sequence[Requirement], extra: str, installed: Callable[[str], str]) -> Results:
    """Check that the packages of an extra, or of the core, are installed in the right versions."""
    absent: list[str] = []
    wrong: list[str] = []
    for one in parsed:
        if one.name == _PACKAGE or (one.marker and not one.marker.evaluate({"extra": extra})):
            continue
        if bool(extra) != ("extra" in str(one.marker)):
            continue
        if not (version := installed(one.name)):
            absent.append(one.name)
        elif not one.specifier.contains(version, prereleases=True):
            wrong.append(f"{one.name} must be {one.specifier}, got {version}")
    wanted = f"'{_PACKAGE}[{extra}]'" if extra else _PACKAGE
    remedy = f"run `pip install --upgrade {wanted}`"
    if wrong:
        yield "bad", f"{'; '.join(wrong)}: {remedy}."
    elif absent:
        yield "unknown", f"Not installed: {', '.join(absent)}; {remedy} if you need this."
    else:
        yield "good", "Installed."


def _drawing() -> Results:
    command = [sys.executable, "-c", _DRAW]
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, timeout=_PATIENCE_S - 1
    )
    if done.returncode == 0:
        yield "good", f"Drew {done.stdout.strip().splitlines()[-1]}."
        return
    last = (done.stderr.strip().splitlines() or [f"exit status {done.returncode}"])[-1]
    yield "bad", last.partition("RenderError: ")[2] or last


def _torch() -> Results:
    import torch

    where = f"{torch.get_num_threads()} threads of the CPU"
    if torch.cuda.is_available():
        where = f"{torch.cuda.get_device_name()} and {where}"
    yield "good", f"{torch.__version__} on {where}."


def _warp() -> Results:
    warp: Any = importlib.import_module("shapechanger.envs.warp.devices").wp
    if devices := [device.name for device in warp.get_cuda_devices()]:
        yield "good", f"Steps on {', '.join(devices)}."
    else:
        yield "unknown", "Steps on the CPU, slowly: CUDA finds no GPU here."


def _gpio(dev: Path) -> Results:
    chips = sorted(dev.glob("gpiochip*"))
    if not chips:
        yield "unknown", "No GPIO on this machine: robots run as twins, on simulated pins."
    elif any(os.access(chip, os.R_OK | os.W_OK) for chip in chips):
        yield "good", "`shapechanger robot check PROFILE` checks the pins of a robot."
    else:
        remedy = "run `sudo usermod -aG gpio $USER` and log in again"
        yield "bad", f"No permission to open {chips[0]}: {remedy}."
