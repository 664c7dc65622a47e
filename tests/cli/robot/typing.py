"""Terminal sessions of commands, which tests send keys to."""

import os
import pty
import re
import select
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Self

_ESCAPES = re.compile(r"\x1b\[[0-9;?]*[a-zA-Z]")


class Person:
    """Runs a command at a pseudo-terminal, with more environment `variables`."""

    def __init__(
        self, arguments: tuple[str, ...], folder: Path, variables: Mapping[str, str] | None = None
    ) -> None:
        self._main, terminal = pty.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", "from shapechanger.cli import main; main()", *arguments],
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            cwd=folder,
            env={**os.environ, "TERM": "xterm", "COLUMNS": "300", **(variables or {})},
            start_new_session=True,
        )
        os.close(terminal)
        self._text = ""
        self._ended = threading.Event()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self.process.poll() is None:
            self.process.terminate()
        self.process.wait(20.0)
        self._ended.set()
        self._reader.join()
        os.close(self._main)

    @property
    def text(self) -> str:
        """Output so far, without escape sequences."""
        return _ESCAPES.sub("", self._text)

    def press(self, keys: str | bytes) -> None:
        os.write(self._main, keys.encode() if isinstance(keys, str) else keys)

    def read_until(self, text: str, after: int = 0, seconds: float = 40.0) -> int:
        """Wait for a text, and return the index of its end."""
        self.wait_for(lambda: text in self.text[after:], seconds, text)
        return self.text.index(text, after) + len(text)

    def wait_for(self, done: Callable[[], bool], seconds: float = 40.0, what: str = "it") -> None:
        until_s = time.monotonic() + seconds
        while not done():
            late = time.monotonic() > until_s or not self._reader.is_alive()
            assert not late or done(), f"{what!r} did not appear; output: {self.text[-2000:]}"
            time.sleep(0.02)

    def end(self, seconds: float = 40.0) -> int:
        return self.process.wait(seconds)

    def _read(self) -> None:
        while not self._ended.is_set():
            if not select.select([self._main], [], [], 0.1)[0]:
                continue
            try:
                self._text += os.read(self._main, 65536).decode(errors="replace")
            except OSError:  # The other end is closed.
                return
