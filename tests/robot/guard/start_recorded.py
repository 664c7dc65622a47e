"""Starts guard or supervisor as `robot/guard/start.py` does, with the tests within reach.

Isolated mode knows no PYTHONPATH, so the folder with the tests is named here. The daemon is a
stand-in.
"""

import importlib.util
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[3]
_START = _ROOT / "src/shapechanger/robot/guard/start.py"


def main(program: str, arguments: list[str]) -> None:
    """Run the guard or the supervisor."""
    sys.path.append(str(_ROOT))
    spec = importlib.util.spec_from_file_location("start", _START)
    assert spec is not None
    assert spec.loader is not None
    start = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(start)
    if program == "guard":
        start.run(program, arguments)
        return
    start._put_package_in_place()
    from shapechanger.robot.guard import supervisor

    python = sys.executable
    here = Path(__file__)
    commands = supervisor.ProcessCommands(
        guard=(python, "-I", str(here), "guard"),
        daemon=(python, "-I", str(here.with_name("stand_in.py"))),
    )
    # The plan is the real one; what is run is told here.
    supervisor.ProcessCommands.of = classmethod(lambda cls, plan: commands)
    supervisor.main(arguments)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
