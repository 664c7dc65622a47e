"""Run benchmarks and print their results next to their targets.

`make bench` prints a table and writes `benchmarks/results/*.json` with the machine's facts. Times
are the median of several rounds, with their spread; compare ratios, not milliseconds, between
machines. Rows that `ONLY` leaves out stay as they were.
"""

from __future__ import annotations

import json
import os
import platform
import shlex
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import mujoco
from gymnasium.envs.mujoco.mujoco_env import expand_model_path
from rich.console import Console
from rich.table import Table

from benchmarks import (
    atlas,
    cloning_real,
    console,
    corrections,
    exchange,
    finger_gap,
    finger_identify,
    finger_learned,
    finger_oracle,
    finger_path,
    finger_physics,
    finger_reach,
    finger_speed,
    generalist,
    gpu,
    references,
    robot_faults,
    robots,
    speed,
    speed_vector,
    vehicles,
    vehicles_studies,
    vehicles_twin,
    waypoints,
)
from benchmarks.row import Row
from shapechanger.bodies.ant import ANT
from shapechanger.errors import UnknownName
from shapechanger.morphology import compile_body
from shapechanger.morphology.effective import fingerprint

RESULTS = Path(__file__).parent / "results"
ROUNDS = 30


def times_ms(work: Callable[[], object]) -> list[float]:
    """Return the milliseconds of each round, sorted."""
    work()
    times: list[float] = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - began))
    return sorted(times)


def timed_row(name: str, work: Callable[[], object], limit_ms: float) -> Row:
    """Return the row of a function with a time limit."""
    times = times_ms(work)
    median = times[len(times) // 2]
    spread = f"{times[0]:.2f} to {times[-1]:.2f} ms in {ROUNDS} rounds"
    return Row(name, f"{median:.2f} ms", spread, f"< {limit_ms:g} ms", median < limit_ms)


def bodies() -> list[Row]:
    """Time edits and compilation."""
    ant_xml = expand_model_path("ant.xml")
    spec = ANT.load(ant_xml)
    rows = [
        timed_row(
            f"edit and compile {name}",
            lambda body=body: compile_body(spec, body),
            10.0,
        )
        for name, body in ANT.bodies.items()
    ]
    bare = times_ms(lambda: mujoco.MjModel.from_xml_path(ant_xml))
    whole = times_ms(lambda: compile_body(ANT.load(ant_xml), ANT.bodies["ExtendedAnt"]))
    ratio = whole[0] / bare[0]
    rows.append(
        Row(
            "load, edit and compile ExtendedAnt, over loading ant.xml",
            f"{ratio:.2f}x",
            f"best of {ROUNDS} rounds each",
            "< 6x",
            ratio < 6.0,
        )
    )
    model = compile_body(spec)
    rows.append(timed_row("fingerprint of Ant", lambda: fingerprint(model), 20.0))
    return rows


def demo() -> list[Row]:
    """Run the demo as a user does."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "demo"
        command = ["shapechanger", "transfer", "InvertedPendulum", "BigInvertedPendulum"]
        command += ["--seeds", "5", "--source-steps", "16384", "--steps", "16384"]
        call = f"import sys; sys.argv = {command!r} + ['--out', {str(out)!r}]; "
        began = time.monotonic()
        subprocess.run(
            [sys.executable, "-c", call + "from shapechanger.cli import main; main()"],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        took = time.monotonic() - began
        study = json.loads((out / "study.json").read_text())
    finals = [
        run["curve"][-1]["mean_return"] for run in study["runs"] if run["run"]["kind"] == "scratch"
    ]
    solved = sum(final >= 900.0 for final in finals)
    ends = ", ".join(f"{final:.0f}" for final in finals)
    gain = study["summaries"]["fine-tune"]["in_target_steps"]["total_reward_gain"]
    return [
        Row("make demo, 5 seeds an arm", f"{took:.0f} s", "one round", "< 60 s", took < 60.0),
        Row("scratch reaches 900", f"{solved} of {len(finals)} seeds", ends, "4 of 5", solved >= 4),
        Row(
            "demo: total reward gain of fine-tune, score",
            f"{gain['value']:+.2f}",
            f"[{gain['low']:+.2f}, {gain['high']:+.2f}]",
            "none: whatever comes out",
            True,
        ),
    ]


SUITES: dict[str, Callable[[], list[Row]]] = {
    "atlas-ants": atlas.ants,
    "atlas-methods": atlas.methods,
    "atlas-pendulums": atlas.pendulums,
    "atlas-replay": atlas.replay,
    "atlas-shank": atlas.shank,
    "atlas-controls": atlas.controls,
    "atlas-claims": atlas.claims,
    "atlas-pages": atlas.pages,
    "bodies": bodies,
    "cloning-real": cloning_real.real,
    "console": console.console,
    "corrections": corrections.corrections,
    "demo": demo,
    "exchange-video": exchange.video,
    "finger-gap": finger_gap.gap,
    "finger-rig": finger_gap.rig,
    "finger-command": finger_gap.command,
    "finger-follow": finger_gap.follow,
    "finger-path": finger_path.path,
    "finger-physics": finger_physics.physics,
    "finger-reach": finger_reach.causes,
    "finger-oracle": finger_oracle.oracle,
    "finger-speed": finger_speed.against_myosuite,
    "finger-learned": finger_learned.learned,
    "finger-identify": finger_identify.identified,
    "gpu": gpu.gpu,
    "references": references.references,
    "generalist": generalist.generalist,
    "speed": speed.single,
    "speed-vector": speed_vector.vector,
    "robot-link": robots.link,
    "robot-fuzz": robots.fuzz,
    "robot-hold": robots.hold,
    "robot-faults": robot_faults.faults,
    "vehicles-frames": vehicles.frames,
    "vehicles-fast": vehicles.fast,
    "vehicles-students": vehicles.students,
    "vehicles-expert": vehicles.expert,
    "vehicles-clone": vehicles.clone,
    "vehicles-on-board": vehicles_twin.on_board,
    "vehicles-twin": vehicles_twin.twin,
    "vehicles-pairs": vehicles_studies.pairs,
    "vehicles-lenses": vehicles_studies.lenses,
    "vehicles-waypoints": waypoints.pairs,
    "vehicles-waypoints-labels": waypoints.labels,
    "vehicles-waypoints-worlds": waypoints.worlds,
    "vehicles-waypoints-robot": waypoints.whole_robot,
    "vehicles-waypoints-remote": waypoints.remote,
    "vehicles-waypoint-studies": vehicles_studies.waypoints,
}


def _asked() -> str:
    """Return the environment variables that were set, as shell assignments."""
    names = ("TRIALS", "FINGERS", "LAYOUTS", "SEEDS", "ONLY", "ENDED", "VEHICLE", "LP_NUM_THREADS")
    return "".join(
        f"{name}={shlex.quote(os.environ[name])} " for name in names if name in os.environ
    )


def _processor() -> str:
    """Return the name of the processor from the system, or its architecture."""
    facts = Path("/proc/cpuinfo")
    lines = facts.read_text().splitlines() if facts.exists() else []
    names = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(names, platform.processor() or platform.machine())


def kept(path: Path, rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows of a former result, with new ones in place of those of the same name.

    A row that is kept from a former run has its command as `measured_by`.

    Args:
        path: The former result, which need not exist.
        rows: The new rows.
    """
    if not path.exists():
        return rows
    former = json.loads(path.read_text())
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
        try:
            rows = SUITES[name]()
        except UnknownName as error:  # In `ONLY`.
            sys.exit(str(error))
        for row in rows:
            table.add_row(row.name, row.value, row.spread, row.target, "yes" if row.met else "NO")
        RESULTS.mkdir(exist_ok=True)
        path = RESULTS / f"{name}.json"
        measured = [asdict(row) for row in rows]
        facts = {
            "command": f"{_asked()}python -m benchmarks.run {name}",
            "machine": f"{platform.system()}, {os.cpu_count()} cores of {_processor()}",
            "python": platform.python_version(),
            "versions": {
                package: version(package)
                for package in ("shapechanger", "mujoco", "gymnasium", "torch")
            },
            "rows": kept(path, measured) if "ONLY" in os.environ else measured,
        }
        path.write_text(json.dumps(facts, indent=1) + "\n")
    Console().print(table)


if __name__ == "__main__":
    main()
