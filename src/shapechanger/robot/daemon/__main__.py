"""`python -m shapechanger.robot.daemon`, as the supervisor starts it."""

from __future__ import annotations

import sys
from typing import Final

from shapechanger.robot.daemon.process import main

__all__: Final[list[str]] = []

if __name__ == "__main__":
    sys.exit(main())
