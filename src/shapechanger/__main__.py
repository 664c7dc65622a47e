"""`python -m shapechanger`: the command `shapechanger`, for programs that start it."""

from __future__ import annotations

from shapechanger.cli import main

if __name__ == "__main__":
    main()
