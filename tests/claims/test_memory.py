"""Memory of many envs."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

_PEER = Path(__file__).parents[2] / "benchmarks" / "vector_peer.py"


@pytest.mark.system
@pytest.mark.skipif(sys.platform != "linux", reason="Needs resident memory of Linux")
def test_an_ant_takes_less_than_a_megabyte() -> None:
    """The mean over 128 running envs is below 1 MB; the benchmark measures 1,024 envs."""
    command = [sys.executable, str(_PEER), "memory", "128", "1"]
    run = subprocess.run(command, check=True, capture_output=True, text=True)
    assert float(run.stdout) < 1e6
