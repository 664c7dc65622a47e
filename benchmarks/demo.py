"""Time and results of `make demo`.

The time is wall-clock time and depends on what else the machine does, so the row states the load
before the demo and the CPU time that the demo took. Measure it on a quiet machine.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.row import Row


def demo() -> list[Row]:
    """Run the command of `make demo`, in another folder."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "demo"
        command = ["shapechanger", "transfer", "InvertedPendulum", "InvertedPendulum"]
        command += ["--target-body", '[{"edit": "stretch", "body": "pole", "factor": 3}]']
        command += ["--seeds", "5", "--source-steps", "16384", "--steps", "16384"]
        call = f"import sys; sys.argv = {command!r} + ['--out', {str(out)!r}]; "
        load, spent_s = os.getloadavg()[0], _cpu_s_of_children()
        began = time.monotonic()
        subprocess.run(
            [sys.executable, "-c", call + "from shapechanger.cli import main; main()"],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        took_s, spent_s = time.monotonic() - began, _cpu_s_of_children() - spent_s
        study = json.loads((out / "study.json").read_text())
    finals = [
        run["curve"][-1]["mean_return"] for run in study["runs"] if run["run"]["kind"] == "scratch"
    ]
    solved = sum(final >= 900.0 for final in finals)
    ends = ", ".join(f"{final:.0f}" for final in finals)
    gain = study["summaries"]["fine-tune"]["in_target_steps"]["total_reward_gain"]
    unchanged = [
        run["curve"][0]["mean_return"] for run in study["runs"] if run["run"]["kind"] == "zero-shot"
    ]
    return [
        Row(
            "make demo without its installation, 5 seeds an arm, wall clock",
            f"{took_s:.0f} s",
            f"{spent_s:.0f} s of CPU time, {os.cpu_count()} cores, load {load:.1f} before",
            "< 60 s on a quiet machine",
            took_s < 60.0,
        ),
        Row("scratch reaches 900", f"{solved} of {len(finals)} seeds", ends, "4 of 5", solved >= 4),
        Row(
            "demo: total reward gain of fine-tune, score",
            f"{gain['value']:+.2f}",
            f"[{gain['low']:+.2f}, {gain['high']:+.2f}]",
            "above 0",
            gain["low"] > 0.0,
        ),
        Row(
            "demo: zero-shot stays below 900",
            f"{sum(value < 900.0 for value in unchanged)} of {len(unchanged)} seeds",
            ", ".join(f"{value:.0f}" for value in unchanged),
            ">= 2 of 5",
            sum(value < 900.0 for value in unchanged) >= 2,
        ),
    ]


def _cpu_s_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
