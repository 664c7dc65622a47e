"""Modules that the guard imports on a twin."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import shapechanger
from shapechanger.robot.twin.start import start_board
from tests.robot.twin.robots import CAR

pytestmark = pytest.mark.realtime

_BARE = """
import sys, types
package = types.ModuleType("shapechanger")
package.__path__ = [sys.argv[1]]
sys.modules["shapechanger"] = package
from shapechanger.robot.hardware import connect
hardware = connect("shapechanger.robot.twin.hardware:connect", sys.argv[2])
hardware.pin_factory()
hardware.i2c(1)
hardware.close()
print(*sorted({name.partition(".")[0] for name in sys.modules}))
"""


def test_the_guard_loads_only_light_modules(tmp_path: Path) -> None:
    """On a twin, the guard imports gpiozero, msgspec and their dependencies only."""
    source = str(Path(shapechanger.__file__).parent)
    with start_board(CAR, "twin", tmp_path) as board:
        command = [sys.executable, "-I", "-c", _BARE, source, board.socket_path]
        run = subprocess.run(command, check=True, capture_output=True, text=True)
    theirs = set(run.stdout.split()) - set(sys.stdlib_module_names)
    assert {name for name in theirs if not name.startswith("_")} <= {
        "colorzero",
        "gpiozero",
        "shapechanger",
        "pkg_resources",
        "importlib_resources",
        "importlib_metadata",
        "lazy_importer",
        "msgspec",
        "typing_extensions",
    }
