"""Policies on board: starting, choosing and ending their processes."""

import asyncio
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from shapechanger.robot.daemon import policies
from shapechanger.robot.daemon.client import Declined
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.daemon.policies import PolicyRunner
from shapechanger.robot.link.messages import PolicyState, Refused, RunPolicy
from tests.robot.daemon.running import Running, until

pytestmark = pytest.mark.plan(policies=".")

# Fake process of a policy: prints its robot, and behaves according to the policy's name.
_PROCESS = """
import json, sys, time
task = json.loads(sys.stdin.readline())
name = task["policy"].rsplit("/", 1)[-1].removesuffix(".onnx")
def tell(**said):
    print(json.dumps(said), flush=True)
tell(note=json.dumps(task["robot"]))
match name:
    case "bad": tell(failed="It gave NaN.")
    case "crash": raise SystemExit(7)
    case "babble": print("x" * 5000, flush=True)
    case _: print("not JSON", "[1]", json.dumps({"note": name + " drives"}), sep="\\n", flush=True)
while name == "deaf":
    time.sleep(60)
if name in ("babble", "student", "teacher"):
    sys.stdin.read()
"""
_COMMAND = (sys.executable, "-c", _PROCESS)
_NAMES = ("babble", "bad", "crash", "deaf", "student", "teacher")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in _NAMES:
        (tmp_path / f"{name}.onnx").write_bytes(b"")
    (tmp_path / "readme.txt").write_text("")
    return tmp_path


@pytest.fixture
def said() -> list[PolicyState]:
    return []


@pytest.fixture
def one(
    folder: Path, plan: DaemonPlan, runner: asyncio.Runner, said: list[PolicyState]
) -> Iterator[PolicyRunner]:
    """The policies of a robot that has started to serve."""
    one = PolicyRunner(plan, said.append)
    one._command = _COMMAND

    async def serve() -> None:
        one.serve(5000, "KEY", b"\x01" * 32)

    runner.run(serve())
    yield one
    runner.run(one.close())


@pytest.mark.plan(policy="student")
async def test_a_policy_starts_with_the_robot_and_another_takes_its_place(
    one: PolicyRunner, said: list[PolicyState]
) -> None:
    await until(lambda: said and said[-1].text == "student drives", "it drives")
    assert [each.running for each in said] == ["student"] * len(said)
    assert said[-1].names == _NAMES
    assert said[0].text == "It starts."
    robot = json.loads(said[1].text)
    assert (robot["address"], robot["key"]) == ("127.0.0.1:5000", "KEY")
    assert robot["fingerprint"] == "01" * 32
    with pytest.raises(Declined, match="student runs already"):
        one.run("student")
    one.run("teacher")
    await until(
        lambda: (said[-1].running, said[-1].text) == ("teacher", "teacher drives"), "it drives"
    )
    one.run("")
    await until(lambda: said[-1] == PolicyState(names=_NAMES), "none runs")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("bad", "bad ended: It gave NaN."),
        ("crash", "crash ended: its process ended with code 7."),
        ("babble", "babble ended: its process wrote a line of more than 1024 bytes."),
    ],
)
async def test_a_policy_that_ends_is_reported(
    one: PolicyRunner, said: list[PolicyState], name: str, text: str
) -> None:
    one.run(name)
    await until(lambda: said and said[-1].running == "" and said[-1].text, "it ended")
    assert said[-1].text.startswith(text)
    one.run("student")
    await until(lambda: said[-1].text == "student drives", "another drives")


async def test_a_deaf_policy_is_killed(
    one: PolicyRunner, said: list[PolicyState], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(policies, "_END_S", 0.05)
    one.run("deaf")
    await until(lambda: said and said[-1].text == "deaf drives", "it drives")
    one.run("")
    await until(lambda: said[-1].running == "", "it is gone")


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("studnt", "Did you mean 'student'"),
        ("../student", "No policy on board"),
        pytest.param("student", "--policy", marks=pytest.mark.plan(policies="")),
    ],
)
async def test_an_unknown_policy_is_refused(
    one: PolicyRunner, said: list[PolicyState], name: str, text: str
) -> None:
    with pytest.raises(Declined, match=text):
        one.run(name)
    assert said == []


@pytest.mark.realtime
async def test_only_a_person_starts_a_policy(folder: Path, robot: Running) -> None:
    async with robot.client(role="program") as program:
        assert (await program.expect(PolicyState)).names == _NAMES
        await program.send(RunPolicy(policy="student"))
        assert "Only a person" in (await program.expect(Refused)).reason
    async with robot.client(role="person") as person:
        await person.send(RunPolicy(policy="studen"))
        assert "student" in (await person.expect(Refused)).reason
