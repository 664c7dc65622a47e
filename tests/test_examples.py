"""The examples run, from another folder and with tiny budgets.

Each example is one file of less than 100 lines that takes `--steps N`.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

_FOLDER = Path(__file__).parents[1] / "examples"
_EXAMPLES = sorted(_FOLDER.glob("*.py"))
# What the last lines of an example say, where they say something worth checking.
_SAYS = {
    "own_robot": ("trunk/qw [1]", "longer front legs: "),
    "new_edit": ('[{"edit":"turn_hinge","joint":"ankle_*"', "halfway: "),
    "six_legged_ant": ("ankle_1_5/motor <- ankle_1/motor", "six legs came "),
}


@pytest.mark.parametrize("example", _EXAMPLES, ids=lambda example: example.stem)
def test_an_example_runs(example: Path, tmp_path: Path) -> None:
    """Without warnings of ours, in a folder that it has never seen."""
    run = subprocess.run(
        [sys.executable, str(example), "--steps", "64"],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    assert run.returncode == 0, run.stderr
    for words in _SAYS.get(example.stem, ()):
        assert words in run.stdout


@pytest.mark.parametrize("example", _EXAMPLES, ids=lambda example: example.stem)
def test_an_example_is_short(example: Path) -> None:
    """It says in its first sentence what it shows, in less than 100 lines."""
    text = example.read_text()
    assert text.count("\n") < 100
    assert '\n"""' in text
