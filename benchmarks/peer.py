"""Something that is measured in a process of its own, maybe of another environment."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence


class Peer:
    """A process that says that it is ready, and then how long what it is asked for took.

    Args:
        command: How to start it.
    """

    def __init__(self, command: Sequence[str]) -> None:
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def ready(self) -> list[str]:
        """What it says of itself once it is under way, its version first.

        Raises:
            RuntimeError: If it does not start: the last that it said.
        """
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        for line in self._process.stdout:  # Others say a word of greeting first.
            said = line.split()
            if said[:1] == ["ready"]:
                return said[1:]
        lines = self._process.stderr.read().strip().splitlines()
        raise RuntimeError(lines[-1] if lines else "it ended without a word")

    def begin(self, steps: int) -> None:
        """Let it step."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{steps}\n")
        self._process.stdin.flush()

    def seconds(self) -> float:
        """How long that took."""
        assert self._process.stdout is not None
        return float(self._process.stdout.readline())

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()
