"""Simulated seconds of a finger per core-second, compared with MyoSuite's finger.

Each round measures both, in alternating order, and gives one ratio.
"""

from __future__ import annotations

import os
import statistics
import sys
from pathlib import Path
from typing import Final

from benchmarks.peer import Peer
from benchmarks.row import Row

ROUNDS: Final = 15
# Simulated time per round.
SECONDS: Final = 20.0
# Interpreter with MyoSuite installed.
MYOSUITE_PYTHON: Final = os.environ.get("SHAPECHANGER_MYOSUITE_PYTHON", sys.executable)
PEER: Final = Path(__file__).with_name("finger_peer.py")


def against_myosuite() -> list[Row]:
    """Compare whole env steps: observations, rewards and resets included."""
    name = "finger: simulated seconds per core-second, ours over MyoSuite's"
    theirs = Peer([MYOSUITE_PYTHON, str(PEER), "myosuite"])
    try:
        made_by, their_dt = theirs.ready()[:2]
    except RuntimeError as error:
        theirs.close()
        return [Row(name, "missing", f"MyoSuite does not start: {error}", ">= 1x", False)]
    ours = Peer([sys.executable, str(PEER), "ours"])
    _, our_dt = ours.ready()[:2]
    sides = {"ours": (ours, float(our_dt)), "theirs": (theirs, float(their_dt))}
    ratios: list[float] = []
    lived: dict[str, list[float]] = {"ours": [], "theirs": []}
    for i in range(ROUNDS):
        order = ("ours", "theirs") if i % 2 else ("theirs", "ours")
        for side in order:
            peer, dt = sides[side]
            steps = round(SECONDS / dt)
            peer.begin(steps)
            lived[side].append(steps * dt / peer.seconds())
        ratios.append(lived["ours"][-1] / lived["theirs"][-1])
    ours.close()
    theirs.close()
    ratios.sort()
    value = statistics.median(ratios)
    return [
        Row(
            f"{name} ({made_by}, myoFingerReachRandom-v0)",
            f"{value:.2f}x",
            f"{ratios[0]:.2f} to {ratios[-1]:.2f}x in {ROUNDS} rounds; ours "
            f"{statistics.median(lived['ours']):.0f} s, a step {1e3 * float(our_dt):g} ms; theirs "
            f"{statistics.median(lived['theirs']):.0f} s, a step {1e3 * float(their_dt):g} ms",
            ">= 1x",
            value >= 1.0,
        )
    ]
