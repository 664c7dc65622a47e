"""Run benchmarks and print their results next to their targets.

`make bench` prints a table and writes `benchmarks/results/*.json` with the machine's facts. Most
times are medians of several rounds, with their spread; compare ratios, not milliseconds, between
machines. Rows that `ONLY` leaves out stay as they were.
"""

from __future__ import annotations

import json
import os
import platform
import shlex
import sys
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from importlib import import_module
from importlib.metadata import version
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

import shapechanger
from benchmarks.row import Row
from shapechanger.errors import UnknownName

RESULTS = Path(__file__).parent / "results"


def _suite(module: str, function: str) -> Callable[[], Iterable[Row]]:
    """Return a suite whose module is imported when it runs, since each needs other packages."""
    return partial(_run, module, function)


def _run(module: str, function: str) -> Iterable[Row]:
    return getattr(import_module(f"benchmarks.{module}"), function)()


SUITES: dict[str, Callable[[], Iterable[Row]]] = {
    "atlas-ants": _suite("atlas", "ants"),
    "atlas-methods": _suite("atlas", "methods"),
    "atlas-pendulums": _suite("atlas", "pendulums"),
    "atlas-replay": _suite("atlas", "replay"),
    "atlas-shank": _suite("atlas", "shank"),
    "atlas-controls": _suite("atlas", "controls"),
    "atlas-claims": _suite("atlas", "claims"),
    "atlas-pages": _suite("atlas", "pages"),
    "bodies": _suite("bodies", "bodies"),
    "cloning-held-out": _suite("cloning_real", "held_out"),
    "cloning-real": _suite("cloning_real", "real"),
    "console": _suite("console", "console"),
    "corrections": _suite("corrections", "corrections"),
    "demo": _suite("demo", "demo"),
    "exchange-video": _suite("exchange", "video"),
    "finger-gap": _suite("finger_gap", "gap"),
    "finger-rig": _suite("finger_gap", "rig"),
    "finger-command": _suite("finger_gap", "command"),
    "finger-follow": _suite("finger_gap", "follow"),
    "finger-path": _suite("finger_path", "path"),
    "finger-physics": _suite("finger_physics", "physics"),
    "finger-reach": _suite("finger_reach", "causes"),
    "finger-oracle": _suite("finger_oracle", "oracle"),
    "finger-speed": _suite("finger_speed", "against_myosuite"),
    "finger-learned": _suite("finger_learned", "learned"),
    "finger-shipped": _suite("finger_learned", "shipped"),
    "finger-identify": _suite("finger_identify", "identified"),
    "gpu": _suite("gpu", "gpu"),
    "gpu-on-cpu": _suite("gpu", "on_cpu"),
    "gpu-generalist": _suite("gpu", "generalist"),
    "mutants": _suite("mutants", "mutants"),
    "references": _suite("references", "references"),
    "generalist": _suite("generalist", "generalist"),
    "generalist-gpu": _suite("generalist", "of_gpu"),
    "generalist-specialists": _suite("generalist", "against_specialists"),
    "speed": _suite("speed", "single"),
    "speed-vector": _suite("speed_vector", "vector"),
    "robot-link": _suite("robots", "link"),
    "robot-fuzz": _suite("robots", "fuzz"),
    "robot-hold": _suite("robots", "hold"),
    "robot-faults": _suite("robot_faults", "faults"),
    "vehicles-frames": _suite("vehicles", "frames"),
    "vehicles-fast": _suite("vehicles", "fast"),
    "vehicles-students": _suite("vehicles", "students"),
    "vehicles-teachers": _suite("standing", "teachers"),
    "vehicles-expert": _suite("vehicles", "expert"),
    "vehicles-clone": _suite("vehicles", "clone"),
    "vehicles-on-board": _suite("vehicles_twin", "on_board"),
    "vehicles-twin": _suite("vehicles_twin", "twin"),
    "vehicles-pairs": _suite("vehicles_studies", "pairs"),
    "vehicles-lenses": _suite("vehicles_studies", "lenses"),
    "vehicles-waypoints": _suite("waypoints", "pairs"),
    "vehicles-waypoints-labels": _suite("waypoints", "labels"),
    "vehicles-waypoints-worlds": _suite("waypoints", "worlds"),
    "vehicles-waypoints-robot": _suite("waypoints", "whole_robot"),
    "vehicles-waypoints-cameras": _suite("waypoints", "cameras"),
    "vehicles-waypoints-remote": _suite("waypoints", "remote"),
    "vehicles-waypoint-studies": _suite("vehicles_studies", "waypoints"),
}


def _asked() -> str:
    """Return the listed environment variables that are set, as shell assignments."""
    names = (
        "TRIALS",
        "FINGERS",
        "LAYOUTS",
        "SEEDS",
        "ONLY",
        "ENDED",
        "VEHICLE",
        "LP_NUM_THREADS",
        "LIMIT",
    )
    return "".join(
        f"{name}={shlex.quote(os.environ[name])} " for name in names if name in os.environ
    )


def _processor() -> str:
    """Return the name of the processor from the system, or its architecture."""
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text().splitlines() if facts.exists() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def _former(suite: str) -> dict[str, Any] | None:
    """Return the former result of a suite if `ONLY` is set, so that rows it leaves out are kept."""
    path = RESULTS / f"{suite}.json"
    return json.loads(path.read_text()) if "ONLY" in os.environ and path.exists() else None


def _write(suite: str, rows: list[Row], former: dict[str, Any] | None) -> None:
    """Write the rows of a suite with the facts of the machine."""
    measured = [asdict(row) for row in rows]
    facts = {
        "command": f"{_asked()}python -m benchmarks.run {suite}",
        "machine": f"{platform.system()}, {os.cpu_count()} cores of {_processor()}",
        "python": platform.python_version(),
        "versions": {package: version(package) for package in ("mujoco", "gymnasium", "torch")}
        | {"shapechanger": shapechanger.__version__},
        "rows": measured if former is None else kept(former, measured),
    }
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{suite}.json").write_text(json.dumps(facts, indent=1) + "\n")


def kept(former: dict[str, Any], rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the former rows, replaced by new ones of the same name, and all other new ones.

    A row that is kept from a former run has its command as `measured_by`.

    Args:
        former: The former result.
        rows: The new rows.
    """
    new = {row["name"]: row for row in rows}
    merged = {
        row["name"]: {**row, "measured_by": row.get("measured_by", former["command"])}
        for row in former["rows"]
    }
    return list((merged | new).values())


def main() -> None:
    """Run the suites named on the command line, or all."""
    names = sys.argv[1:] or list(SUITES)
    for name in names:
        if name not in SUITES:
            sys.exit(str(UnknownName("suite", name, SUITES)))
    table = Table("measured", "value", "spread", "target", "met", box=None)
    for name in names:
        rows: list[Row] = []
        former = _former(name)
        try:
            for row in SUITES[name]():
                yes = "yes" if row.met else "NO"
                table.add_row(row.name, row.value, row.spread, row.target, yes)
                # After each row, so that a run that is cut off keeps its results.
                rows.append(row)
                _write(name, rows, former)
        except UnknownName as error:  # `ONLY` contains an unknown name.
            sys.exit(str(error))
    Console().print(table)


if __name__ == "__main__":
    main()
