"""Time and results of `make demo`."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.row import Row


def demo() -> list[Row]:
    """Run the demo as a user does."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "demo"
        command = ["shapechanger", "transfer", "InvertedPendulum", "InvertedPendulum"]
        command += ["--target-body", '[{"edit": "stretch", "body": "pole", "factor": 3}]']
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
    unchanged = [
        run["curve"][0]["mean_return"] for run in study["runs"] if run["run"]["kind"] == "zero-shot"
    ]
    return [
        Row("make demo, 5 seeds an arm", f"{took:.0f} s", "one round", "< 60 s", took < 60.0),
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
