"""Fixtures for tests of commands."""

from __future__ import annotations

import pytest

from tests.cli.running import Cli


@pytest.fixture
def cli(capsys: pytest.CaptureFixture[str]) -> Cli:
    return Cli(capsys)


@pytest.fixture
def demos(capsys: pytest.CaptureFixture[str]) -> Cli:
    return Cli(capsys, "demos")


@pytest.fixture
def finger(capsys: pytest.CaptureFixture[str]) -> Cli:
    return Cli(capsys, "finger")
