"""Process to measure, possibly in another Python environment."""

from __future__ import annotations

import subprocess
from collections.abc import Sequence


class Peer:
    """Process that prints `ready`, then the duration of each request.

    Args:
        command: Command that starts the process.
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
        """Wait for the process and return its description, version first.

        Raises:
            RuntimeError: If it does not start, with its last line on standard error.
        """
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        for line in self._process.stdout:  # Some libraries print a banner first.
            words = line.split()
            if words[:1] == ["ready"]:
                return words[1:]
        lines = self._process.stderr.read().strip().splitlines()
        raise RuntimeError(lines[-1] if lines else "it ended without output")

    def begin(self, steps: int) -> None:
        """Request a number of steps."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{steps}\n")
        self._process.stdin.flush()

    def seconds(self) -> float:
        """Return the duration of the last request."""
        assert self._process.stdout is not None
        return float(self._process.stdout.readline())

    def close(self) -> None:
        """Kill the process."""
        self._process.kill()
        self._process.communicate()
