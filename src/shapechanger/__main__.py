"""`python -m shapechanger` runs the command `shapechanger`."""

from __future__ import annotations

from shapechanger.cli import main

if __name__ == "__main__":
    main()
