"""Helper to run commands in this process."""

from __future__ import annotations

from typing import NamedTuple

import pytest

from shapechanger.cli import main


class Printed(NamedTuple):
    """Output and errors of a command."""

    out: str
    err: str


class Cli:
    """The command `shapechanger`, or a group of its commands, with the same first words."""

    def __init__(self, capsys: pytest.CaptureFixture[str], *group: str) -> None:
        self._capsys = capsys
        self._group = group

    def ended(self, code: int, *arguments: object) -> Printed:
        self._capsys.readouterr()
        found: object = 0
        try:
            main([*self._group, *map(str, arguments)])
        except SystemExit as stop:
            found = stop.code or 0
        printed = Printed(*self._capsys.readouterr())
        assert found == code, printed
        return printed

    def output(self, *arguments: object) -> str:
        return self.ended(0, *arguments).out

    def refused(self, *arguments: object) -> str:
        """Return the error of a command that must end with exit code 2; it must be one sentence."""
        message = self.ended(2, *arguments).err
        assert message.startswith("error: ")
        assert message.count("\n") == 1, message
        return message
