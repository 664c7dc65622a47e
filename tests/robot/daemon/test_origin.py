"""Origin check of connections from web pages."""

from __future__ import annotations

import pytest

from shapechanger.robot.daemon.server import origin_refusal


@pytest.mark.parametrize(
    ("origin", "host", "is_open", "allowed"),
    [
        (None, "anything", True, True),
        ("https://car.local:5000", "car.local:5000", False, True),
        ("https://CAR.local:5000", "car.local:5000", False, True),
        ("https://evil.example", "car.local:5000", False, False),
        ("null", "car.local:5000", False, False),
        ("http://evil.example:5000", "evil.example:5000", False, True),
        ("http://evil.example:5000", "evil.example:5000", True, False),
        ("http://127.0.0.1:5000", "127.0.0.1:5000", True, True),
        ("http://[::1]:5000", "[::1]:5000", True, True),
        ("http://localhost:5000", "localhost:5000", True, True),
        ("http://a b", "a b", True, False),
    ],
)
def test_only_the_robots_own_page_may_connect(
    origin: str | None, host: str, is_open: bool, allowed: bool
) -> None:
    assert (origin_refusal(origin, host, is_open=is_open) == "") == allowed
