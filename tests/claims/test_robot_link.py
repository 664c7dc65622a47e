"""The benchmark of the link runs with the present daemon."""

import pytest

from benchmarks.echo import EchoRobot

pytestmark = [pytest.mark.realtime, pytest.mark.system]


def test_every_command_is_answered_with_a_picture() -> None:
    with EchoRobot() as echo:
        assert len(echo.round_trips(20)) == 20
