"""A short run of `benchmarks/fuzz_link.py`."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path

import aiohttp
import pytest

from benchmarks.fuzz_link import fuzz, mutated
from tests.robot.daemon.plans import car_plan
from tests.robot.daemon.running import running

pytestmark = pytest.mark.realtime


def test_mutated_messages_crash_nothing_and_move_nothing() -> None:
    counts = fuzz(5_000, seed=1)
    assert counts["strangers refused"] == 1_250
    assert counts["connections ended"] > 1_000
    assert counts["understood"] > 10


def test_mutated_messages_over_a_socket(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    secret = tmp_path / "secret"
    secret.mkdir()
    (secret / "episode.json").write_text("{}")
    rng = random.Random(2)

    async def play() -> None:
        async with running(car_plan(recordings=str(tmp_path / "kept")), monkeypatch) as robot:
            for _ in range(40):
                async with robot.client() as client:
                    try:
                        for _ in range(20):
                            await client.socket.send_bytes(mutated(rng))
                    except (ConnectionError, aiohttp.ClientError):
                        continue
            async with robot.client(role="person") as client:
                await robot.armed(client)
                assert (await client.drive(1, 0.0, 0.5)).applied_seq == 1
            moving = [order for order in robot.guard.orders if order.kind == "command"]
            assert [order.values for order in moving] == [(0.0, 0.5)]
            # Programs cannot record, so no file was written.
            assert [path.name for path in tmp_path.iterdir()] == ["secret"]
            assert [path.name for path in secret.iterdir()] == ["episode.json"]

    asyncio.run(play())
