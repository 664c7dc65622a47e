"""Commands that run in this process."""

from __future__ import annotations

import pytest

from shapechanger.cli import main


class Cli:
    """The command `shapechanger`, or a group of it.

    Args:
        capsys: What has been printed.
        group: The first words of each command.
    """

    def __init__(self, capsys: pytest.CaptureFixture[str], *group: str) -> None:
        self._capsys = capsys
        self._group = group

    def output(self, *words: object) -> str:
        """Return the standard output of a command."""
        self._capsys.readouterr()
        main([*self._group, *map(str, words)])
        return self._capsys.readouterr().out

    def refused(self, *words: object) -> str:
        """Return the error of a command, which is one sentence, after exit code 2."""
        self._capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([*self._group, *map(str, words)])
        message = self._capsys.readouterr().err
        assert stop.value.code == 2, message
        assert message.startswith("error: ")
        assert message.count("\n") == 1, message
        return message
