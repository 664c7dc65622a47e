"""The examples run, from another folder and with tiny budgets.

Each script has fewer than 100 lines and takes `--steps N`; the cells of the notebook run in turn.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

_FOLDER = Path(__file__).parents[1] / "examples"
_EXAMPLES = sorted(_FOLDER.glob("*.py"))
_FEW = ("--steps", "64")
# A study needs at least as many steps as there are between two evaluations.
_ARGUMENTS = dict.fromkeys(("new_method", "study_on_ray"), ("--steps", "4096", "--seeds", "2"))
# Parts of the outputs of some examples.
_OUTPUTS = {
    "own_robot": ("trunk/qw [1]", "longer front legs: "),
    "new_edit": ('[{"edit":"turn_hinge","joint":"ankle_*"', "halfway: "),
    "six_legged_ant": ("ankle_1_5/motor <- ankle_1/motor", "six legs came "),
    "two_bodies": ("hinge/angle      rad", "pole: length 0.6 m -> 1.2 m (x2)", "pole of 1.20 m: "),
    "simulation_and_robot": ("in 64 steps, 0 collisions",),
    "new_vehicle": ("steering  1.0, throttle 0.0: tracks  1.00 and -1.00", "driven 2."),
    "new_method": ("4,096 target steps",),
    "study_on_ray": ("fine-tune-1 has ended", "report.html"),
}


@pytest.mark.gl
@pytest.mark.system
@pytest.mark.realtime
@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize("example", _EXAMPLES, ids=lambda example: example.stem)
def test_an_example_runs(example: Path, tmp_path: Path) -> None:
    """An example runs in an empty folder, and prints the expected parts."""
    run = subprocess.run(
        [sys.executable, str(example), *_ARGUMENTS.get(example.stem, _FEW)],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert run.returncode == 0, run.stderr
    for words in _OUTPUTS.get(example.stem, ()):
        assert words in run.stdout


@pytest.mark.parametrize("example", _EXAMPLES, ids=lambda example: example.stem)
def test_an_example_is_short(example: Path) -> None:
    """An example has a docstring and fewer than 100 lines."""
    text = example.read_text()
    assert text.count("\n") < 100
    assert '\n"""' in text


@pytest.mark.gl
@pytest.mark.system
@pytest.mark.usefixtures("gl")
def test_the_cells_of_the_notebook_run(tmp_path: Path) -> None:
    """The policy walks best with the shanks that it was trained with."""
    notebook = json.loads((_FOLDER / "first_transfer.ipynb").read_text())
    cells = ["".join(c["source"]) for c in notebook["cells"] if c["cell_type"] == "code"]
    script = tmp_path / "cells.py"
    script.write_text("\n".join([*cells, "assert max(ways) == ways[2] > 30.0, ways"]))
    run = subprocess.run(
        [sys.executable, str(script)],
        check=False,
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env={**os.environ, "MPLBACKEND": "agg"},
    )
    assert run.returncode == 0, run.stderr
