"""Entry point, run by path in isolated mode: `python -I start.py PROGRAM ARGUMENTS`.

The guard and its supervisor must be small and must not fail because of an unneeded import. So the
package `shapechanger` is created here without running its `__init__`, which would load Gymnasium
and NumPy; its modules are then imported as usual.
"""

from __future__ import annotations

import importlib
import sys
import types
from pathlib import Path
from typing import Final

_PROGRAMS: Final = {
    "guard": "shapechanger.robot.guard.process",
    "supervise": "shapechanger.robot.guard.supervisor",
}
"""Module of each program."""


def _put_package_in_place() -> None:
    package = types.ModuleType("shapechanger")
    package.__path__ = [str(Path(__file__).resolve().parents[2])]
    sys.modules["shapechanger"] = package


def run(program: str, arguments: list[str]) -> None:
    """Run a program of the robot without loading the rest of the package."""
    if "shapechanger" not in sys.modules:
        _put_package_in_place()
    importlib.import_module(_PROGRAMS[program]).main(arguments)


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2:])
