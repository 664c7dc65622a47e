"""`python -m shapechanger.robot.daemon`, as the supervisor starts it."""

from __future__ import annotations

import sys

from shapechanger.robot.daemon.process import main

if __name__ == "__main__":
    sys.exit(main())
