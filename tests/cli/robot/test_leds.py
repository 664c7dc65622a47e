"""The bench of one Pi with LEDs: on simulated pins, and as a whole on a twin."""

from __future__ import annotations

import contextlib
import getpass
import math
import socket
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from gpiozero.pins.mock import MockFactory, MockPWMPin

from shapechanger.cli import main
from shapechanger.cli.robot import leds
from shapechanger.cli.robot.checks import SelftestResult
from shapechanger.cli.robot.leds import (
    Bench,
    ProbeJudge,
    ask_nobody,
    ask_person,
    lamps_of,
    probed_pin,
    walk,
)
from shapechanger.cli.robot.leds_report import anonymous, facts, run_leds
from shapechanger.errors import LinkError, OutputError, RobotError
from shapechanger.robot.guard.plan import GuardPlan
from shapechanger.robot.hardware import RealHardware
from shapechanger.robot.profile.load import find_profile, load_profile
from shapechanger.robot.profile.profile import Profile


def _profile(kind: str) -> Profile:
    return load_profile(find_profile(kind))


class _Pins(RealHardware):
    """gpiozero's mock pins, which stay as they are when they are closed."""

    def __init__(self) -> None:
        super().__init__()
        self.factory: Any = MockFactory(pin_class=MockPWMPin)

    def pin_factory(self) -> Any:
        return self.factory

    def close(self) -> None:
        pass


@pytest.fixture
def pins(monkeypatch: pytest.MonkeyPatch) -> Iterator[_Pins]:
    """Fake pins; LEDs are not shown for long."""
    monkeypatch.setattr(leds, "_SHOWN_S", 0.0)
    made = _Pins()
    yield made
    made.factory.close()


def _walked(
    plan: GuardPlan, pins: _Pins, ask: Callable[[str], bool | None]
) -> dict[str, SelftestResult]:
    return {one.name: one for one in walk(plan, lambda: pins, ask, None)}


@pytest.mark.parametrize(
    ("kind", "places"),
    [
        ("car", ["GPIO22", "GPIO27", "GPIO4", "GPIO17", "GPIO19"]),
        ("tank", [f"GPIO{pin}" for pin in (17, 27, 22, 23, 24, 25)]),
        ("boat", ["GPIO18", "GPIO12"]),
        ("truck", [f"channel {number} of the pca9685" for number in range(4)]),
    ],
)
def test_each_output_has_its_leds(kind: str, places: list[str]) -> None:
    """A motor has one for each direction, and one for its enable input."""
    assert [lamp.place for lamp in lamps_of(_profile(kind).guard_plan())] == places


def test_a_servo_bus_takes_no_leds() -> None:
    """The error names a robot that does."""
    with pytest.raises(RobotError, match=r"servo on a bus .*`init car`"):
        lamps_of(_profile("finger").guard_plan())


def test_each_led_is_lit_alone(pins: _Pins) -> None:
    """The person is asked while it is lit; all are out at the end."""
    plan = _profile("car").guard_plan()
    numbers = [22, 27, 4, 17, 19]
    seen: list[list[int]] = []

    def ask(question: str) -> bool:
        lit = [n for n in numbers if pins.factory.pin(n).state]
        seen.append(lit)
        assert f"GPIO{lit[0]} lit" in question
        return lit != [4]

    found = _walked(plan, pins, ask)
    assert seen == [[n] for n in numbers]
    assert not any(pins.factory.pin(n).state for n in numbers)
    assert {name for name, one in found.items() if one.level == "bad"} == {"LED GPIO4"}
    assert found["LED GPIO4"].sentence == "steer forward: NOT lit."


def test_unanswered_leds_are_not_measured(pins: _Pins) -> None:
    """They are neither good nor bad."""
    found = _walked(_profile("car").guard_plan(), pins, ask_nobody)
    assert {one.level for one in found.values()} == {"unknown"}


def test_a_missing_servo_board_does_not_end_the_walk(
    pins: _Pins, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each of its channels is reported."""

    def no_bus(_: int) -> None:
        raise OSError(121, "Remote I/O error")

    monkeypatch.setattr(pins, "i2c", no_bus)
    found = _walked(_profile("truck").guard_plan(), pins, ask_nobody)
    assert [one.level for one in found.values()] == ["bad"] * 4
    assert "does not answer" in found["LED channel 0 of the pca9685"].sentence


def test_a_probe_measures_the_stop(pins: _Pins, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is the time of the last edge; a pin that stays high never stops."""
    now_ns = 0
    monkeypatch.setattr("time.monotonic_ns", lambda: now_ns)
    plan = _profile("car").guard_plan()
    judge = ProbeJudge(20, probed_pin(plan, 20), pins)
    wire = pins.factory.pin(20)
    now_ns = 1_000_000_000
    wire.drive_high()
    assert judge.moves()
    assert math.isinf(judge.rest_ms(now_ns))
    now_ns += 30_000_000
    wire.drive_low()
    assert judge.moves()
    assert judge.rest_ms(1_000_000_000) == 30.0
    assert judge.rest_ms(2_000_000_000) == 0.0
    now_ns += 50_000_000
    assert not judge.moves()
    (lamp, other) = lamps_of(plan)[:2]
    assert (judge.sees(lamp), judge.sees(other)) == (False, None)
    judge.close()


@pytest.mark.parametrize(
    ("kind", "probe", "words"),
    [("car", 27, "used by drive backward"), ("boat", 20, "needs a motor on an H-bridge")],
)
def test_probes_that_cannot_measure(kind: str, probe: int, words: str) -> None:
    """A pin of the robot, and a servo's pulses, which go on at rest."""
    with pytest.raises(RobotError, match=words):
        probed_pin(_profile(kind).guard_plan(), probe)
    assert probed_pin(_profile("tank").guard_plan(), 20) == 17


def test_questions_are_repeated(monkeypatch: pytest.MonkeyPatch) -> None:
    """Only yes, no and the end of the input are answers."""
    answers = iter(["", "maybe", "Y", "no"])

    def answer(_: str) -> str:
        try:
            return next(answers)
        except StopIteration:
            raise EOFError from None

    monkeypatch.setattr("builtins.input", answer)
    assert [ask_person("Is it lit?") for _ in range(3)] == [True, False, None]


class _Bench(Bench):
    """A bench with results of its own."""

    def __init__(self, *results: SelftestResult | BaseException) -> None:
        self._results = results

    def results(self) -> Iterator[tuple[str, SelftestResult | None]]:
        yield "checks", None
        for result in self._results:
            if isinstance(result, BaseException):
                raise result
            yield "checks", result


def test_a_report_names_nobody(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither this computer nor its user; the model of the board is there."""
    monkeypatch.setattr(socket, "gethostname", lambda: "annas-pi")
    monkeypatch.setattr(getpass, "getuser", lambda: "anna")
    monkeypatch.setattr(Path, "home", lambda: Path("/home/anna"))
    model = tmp_path / "proc/device-tree/model"
    model.parent.mkdir(parents=True)
    model.write_text("Raspberry Pi 5 Model B Rev 1.0\0")
    sentence = "anna owns /home/anna/car.toml on annas-pi, and a banana."
    assert anonymous(sentence) == "USER owns ~/car.toml on HOST, and a banana."
    found = facts(_profile("car"), twin=False, root=tmp_path)
    assert any(
        line.split(maxsplit=1) == ["board", "Raspberry Pi 5 Model B Rev 1.0"] for line in found
    )
    report = tmp_path / "report.txt"
    good = SelftestResult("drives", "good", sentence)
    assert run_leds(_Bench(good), _profile("car"), report, twin=False)
    text = report.read_text()
    assert "good  drives: USER owns ~/car.toml on HOST" in text
    assert "1 good, 0 bad, 0 not measured." in text
    assert "anna" not in text.replace("banana", "")


def test_a_person_judges_each_fault() -> None:
    """The question names the fault; an LED that never was lit proves no stop."""
    asked: list[str] = []

    def ask(question: str) -> bool:
        asked.append(question)
        return len(asked) == 1

    bench = Bench(_profile("car"), twin=True, probe=None, ask=ask, cap=0.2)
    results = [bench._judge_stop(name, None, 0, 270.0) for name in ("driver killed", "disarmed")]
    assert [result.level for result in results] == ["good", "bad"]
    assert asked[0] == ("Did a motor's LED light up, and are all of them out now (driver killed)?")
    assert results[1].sentence == "NOT lit, or NOT out afterwards."


def test_a_part_is_named_before_its_questions(pins: _Pins, monkeypatch: pytest.MonkeyPatch) -> None:
    """The heading comes when no LED was asked for yet."""
    asked: list[str] = []
    bench = Bench(_profile("car"), twin=True, probe=None, ask=asked.append, cap=0.2)
    monkeypatch.setattr(bench, "_board", lambda *_: None)
    monkeypatch.setattr(bench, "_wiring", lambda _: iter(()))
    monkeypatch.setattr(bench, "_judged", lambda _: contextlib.nullcontext())
    monkeypatch.setattr(leds, "_pins", lambda _: pins)
    results = bench.results()
    assert [next(results), next(results)] == [("wiring", None), ("LEDs", None)]
    assert asked == []
    part, result = next(results)
    assert part == "LEDs"
    assert result is not None
    assert len(asked) == 1


def test_a_report_is_kept_whatever_happens(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was found before an error stays, and so do earlier reports."""
    report = tmp_path / "report.txt"
    bad = SelftestResult("drives", "bad", "It did not.")
    assert not run_leds(_Bench(bad), _profile("car"), report, twin=False)
    with pytest.raises(RobotError, match="gone"):
        run_leds(_Bench(bad, RobotError("gone")), _profile("car"), report, twin=False)
    with pytest.raises(KeyboardInterrupt):
        run_leds(_Bench(KeyboardInterrupt()), _profile("car"), report, twin=False)
    # Its errors are no errors of writing, although they inherit from OSError.
    with pytest.raises(LinkError, match=r"^silent$"):
        run_leds(_Bench(LinkError("silent")), _profile("car"), report, twin=False)
    second, third = (tmp_path / f"report-{number}.txt" for number in (2, 3))
    assert f"{third} has what was tested so far." in capsys.readouterr().out
    assert "0 good, 1 bad" in report.read_text()
    assert second.read_text().endswith("BAD   drives: It did not.\n\nIt ended early: gone\n")
    assert "It ended early: it was interrupted." in third.read_text()
    with pytest.raises(OutputError, match="Cannot write"):
        run_leds(_Bench(bad), _profile("car"), report / "below.txt", twin=False)


@pytest.mark.realtime
@pytest.mark.system
def test_the_bench_of_a_twin(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """LEDs, checks and faults run as on a Pi, judged by the ledger, and end in one report."""
    monkeypatch.chdir(tmp_path)
    # A busy machine may be late, which is not what this test is about.
    with contextlib.suppress(SystemExit):
        main(["robot", "selftest", "car", "--twin", "--leds"])
    (report,) = tmp_path.iterdir()
    text = report.read_text()
    assert report.name == "leds-report.txt"
    for part in ("wiring", "LEDs", "checks", "faults"):
        assert f"\n\n{part}\n" in text
    for place in ("GPIO22", "GPIO27", "GPIO4", "GPIO17", "GPIO19"):
        assert f"good  LED {place}: " in text
    for fault in leds._FAULTS:
        assert f"  {fault}: At rest " in text
    assert "At rest never" not in text
    assert text.strip().endswith("not measured.")
    assert "wrote leds-report.txt" in capsys.readouterr().out
