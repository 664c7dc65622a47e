"""Record steps without end and report each written one, for the test that kills the recorder.

Forks a recorder for each line on standard input, and prints its pid, and "dead" after its exit.
Each recorder writes a byte to standard error for each step.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from shapechanger.demos.episodes import EpisodeWriter
from tests.demos.episodes.making import header, picture, step


def main(folder: Path) -> None:
    """Fork a recorder for each line that is read."""
    for number, _ in enumerate(sys.stdin):
        pid = os.fork()
        if pid == 0:
            _record(folder / str(number))
        os.write(1, f"{pid}\n".encode())
        os.waitpid(pid, 0)
        os.write(1, b"dead\n")


def _record(folder: Path) -> None:
    writer = EpisodeWriter.create(folder, header(), spare_bytes=0)
    number = 0
    while True:
        writer.add(step(number), picture(number) * 20)
        os.write(2, b".")
        number += 1


if __name__ == "__main__":
    main(Path(sys.argv[1]))
