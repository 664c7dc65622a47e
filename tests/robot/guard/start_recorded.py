"""Start the guard or the supervisor like `robot/guard/start.py`, but able to import `recording.py`.

The arguments are the path of `start.py`, the program, and its arguments. Isolated mode ignores
PYTHONPATH, so the repository is added to the path here. `stand_in.py` replaces the daemon.
"""

import runpy
import sys
from pathlib import Path

_HERE = Path(__file__).resolve()


def main(path: str, program: str, *arguments: str) -> None:
    """Run the guard or the supervisor."""
    sys.path.append(str(_HERE.parents[3]))
    start = runpy.run_path(path)
    if program == "guard":
        start["run"](program, arguments)
        return
    start["_put_package_in_place"]()
    from shapechanger.robot.guard import supervisor

    isolated = [sys.executable, "-I"]
    commands = {
        "guard": [*isolated, str(_HERE), path, "guard"],
        "daemon": [*isolated, str(_HERE.with_name("stand_in.py"))],
    }
    # Use the real plan, but these commands.
    vars(supervisor)["command_of"] = lambda name, _: commands[name]
    supervisor.main(arguments)


if __name__ == "__main__":
    main(*sys.argv[1:])
