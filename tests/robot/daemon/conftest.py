"""Fixture `robot`: a daemon for each test. Coroutine tests run in its event loop, if any."""

import asyncio
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.robot.daemon.credentials import load_credentials, make_credentials
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.hardware import Clock
from shapechanger.robot.link.authentication import parse_key
from tests.robot.daemon.fakes import SteppedClock
from tests.robot.daemon.plans import car_plan
from tests.robot.daemon.running import Running, running


def pytest_configure(config: pytest.Config) -> None:
    text = "plan(secured=False, **changes): plan of the daemon; secured: with TLS and a key"
    config.addinivalue_line("markers", text)


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> bool | None:
    if not inspect.iscoroutinefunction(pyfuncitem.obj):
        return None
    names = inspect.signature(pyfuncitem.obj).parameters
    script = pyfuncitem.obj(**{name: pyfuncitem.funcargs[name] for name in names})
    run = pyfuncitem.funcargs["runner"].run if "runner" in pyfuncitem.funcargs else asyncio.run
    run(script)
    return True


@pytest.fixture
def plan(request: pytest.FixtureRequest, tmp_path: Path) -> DaemonPlan:
    """The plan of a car with the changes of `@pytest.mark.plan`."""
    changes = {}
    for marker in reversed([*request.node.iter_markers("plan")]):
        changes |= marker.kwargs
    if changes.pop("secured", False):
        changes["credentials"] = str(make_credentials(tmp_path / "car", "car").folder)
    for name in changes.keys() & {"recordings", "policies"}:  # Folders, or "" for none.
        changes[name] = changes[name] and str(tmp_path / changes[name])
    return car_plan(**changes)


@pytest.fixture
def key(plan: DaemonPlan) -> bytes:
    """The key of the robot; empty if it accepts every client."""
    made = plan.credentials and load_credentials(Path(plan.credentials))
    return parse_key(made.key) if made else b""


@pytest.fixture
def runner() -> Iterator[asyncio.Runner]:
    with asyncio.Runner() as runner:
        yield runner


@pytest.fixture
def robot(
    plan: DaemonPlan, runner: asyncio.Runner, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Running]:
    """A served robot; its time moves in steps if the plan's clock is "twin"."""
    clock = SteppedClock() if plan.card.clock == "twin" else Clock()
    serving = running(plan, monkeypatch, clock)
    robot = runner.run(serving.__aenter__())
    if isinstance(clock, SteppedClock):
        clock.tick = robot.guard.tick
    yield robot
    runner.run(serving.__aexit__(None, None, None))
