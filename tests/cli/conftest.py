"""Fixtures for tests of commands."""

from __future__ import annotations

import pytest

from tests.cli.running import Cli


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Cli:
    """The command `shapechanger`."""
    return Cli(capsys)


@pytest.fixture
def demos(capsys: pytest.CaptureFixture[str]) -> Cli:
    """The commands `shapechanger demos ...`."""
    return Cli(capsys, "demos")


@pytest.fixture
def finger(capsys: pytest.CaptureFixture[str]) -> Cli:
    """The commands `shapechanger finger ...`."""
    return Cli(capsys, "finger")
