"""Pacing of observations."""

import asyncio

import pytest

from shapechanger.robot.link.messages import Acknowledge, Command, Observation
from tests.robot.daemon.fakes import SteppedClock
from tests.robot.daemon.plans import picture
from tests.robot.daemon.running import Running, until

pytestmark = pytest.mark.realtime


STEPPED = pytest.mark.plan(
    clock="twin", control_hz=20.0, tick_hz=100.0, arming="anyone", camera=None
)


def stepped(robot: Running) -> SteppedClock:
    assert isinstance(robot.clock, SteppedClock)
    return robot.clock


@STEPPED
async def test_in_lockstep_each_command_is_one_period(robot: Running) -> None:
    clock = stepped(robot)
    async with robot.client(pace="lockstep") as client:
        await client.take()
        await robot.arm(client)
        seen = await client.observe()
        assert clock.steps == [0.05, 0.01, 0.05]
        assert seen.armed
        for seq in range(1, 50):
            before_ns = clock.ns
            await client.send(Command(seq=seq, answers=seen.seq, values=(0.0, 0.5)))
            seen = await client.expect(Observation)
            assert seen.state_ns == clock.ns == before_ns + 50_000_000
            assert seen.applied_seq == seq
            assert seen.command_ns == before_ns
    await until(lambda: robot.guard.kinds()[-1] == "disarm", "it is disarmed")


@pytest.mark.plan(clock="twin")
async def test_lockstep_waits_for_its_frame(robot: Running) -> None:
    clock = stepped(robot)

    def tick() -> None:
        robot.guard.tick()
        clock.captured_ns = clock.ns
        asyncio.get_running_loop().call_later(0.02, robot.show)

    clock.tick = tick
    async with robot.client(pace="lockstep") as client:
        for _ in range(5):
            seen = await client.observe()
            assert seen.frame is not None
            assert seen.captured_ns == clock.ns


@STEPPED
async def test_the_client_in_control_advances_time_in_steps(robot: Running) -> None:
    """The limit of messages per second does not apply in lockstep."""
    clock = stepped(robot)
    async with robot.client(pace="lockstep") as driver, robot.client() as watcher:
        await driver.take()
        for _ in range(1_000):
            await driver.observe()
        stood_ns = clock.ns
        for _ in range(3):
            assert (await watcher.observe()).sent_ns == stood_ns
        await driver.observe()
        assert clock.ns == stood_ns + 50_000_000


async def test_in_real_time_an_observation_costs_a_credit(robot: Running) -> None:
    async with robot.client() as client:
        robot.show()
        seen = await client.observe()
        while seen.frame_seq != 1:
            seen = await client.observe()
        for _ in range(5):
            robot.show()
        async with robot.client() as other:
            while (newest := await other.observe()).frame != picture(6):
                pass
        for _ in range(3):
            await client.send(Acknowledge())
        assert (await client.expect(Observation)).frame_seq == newest.frame_seq
        pending = [message for message in client.received if isinstance(message, Observation)]
        assert pending[-1].seq == seen.seq + 1


@pytest.mark.plan(control_hz=50.0, camera=None)
async def test_without_frames_observations_are_sent_once_a_period(robot: Running) -> None:
    async with robot.client() as client:
        first = await client.observe()
        for _ in range(10):
            last = await client.observe()
        assert last.sent_ns - first.sent_ns >= 0.95 * 10 * 20_000_000
