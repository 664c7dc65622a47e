"""Start the guard or the supervisor as `robot/guard/start.py` does, with importable tests.

Isolated mode ignores PYTHONPATH, so the repository is added to the path here. The daemon is a
stand-in.
"""

import importlib.util
import sys
from pathlib import Path

_ROOT = Path(__file__).resolve().parents[3]
# Of the installed package, which is not imported yet.
_PACKAGE = importlib.util.find_spec("shapechanger")
assert _PACKAGE is not None
assert _PACKAGE.origin is not None
_START = Path(_PACKAGE.origin).parent / "robot/guard/start.py"


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
    commands = {
        "guard": [python, "-I", str(here), "guard"],
        "daemon": [python, "-I", str(here.with_name("stand_in.py"))],
    }
    # Use the real plan, but these commands.
    supervisor.command_of = lambda name, _: commands[name]
    supervisor.main(arguments)


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2:])
