"""Messages of faults, and their effect on the tendons; arbitrary bytes on the bus."""

import math
from collections.abc import Callable

import pytest
from hypothesis import HealthCheck, given
from hypothesis import settings as examples
from hypothesis import strategies as st

from shapechanger.errors import RobotError
from shapechanger.robot.hardware import ServoReply
from tests.robot.drivers.servos.rigs import CYCLE_NS, NAMES, Rig, of
from tests.robot.drivers.servos.wire import FEETECH, pack, status

_Fault = Callable[[Rig], object]


def _breaks(fault: str) -> _Fault:
    return lambda rig: rig.line.break_servo("EIP", fault)


def _set(attribute: str, value: float) -> _Fault:
    """Return a fault that sets an attribute of the servo EIP or of its motor."""

    def fault(rig: Rig) -> None:
        servo = rig.twin("EIP")
        setattr(servo if hasattr(servo, attribute) else servo.motor, attribute, value)

    return fault


# Only for Dynamixel: a Feetech servo with a low limit is slow even without load.
_SNAPPED = (_breaks("snapped"), "has lost its tendon: it winds in at")
_FAULTS: list[tuple[_Fault, str]] = [
    (_set("temperature", 68.0), "has 68 C, more than 65 C"),
    (_breaks("hot"), "switched itself off: it is overheated. Only a reboot"),
    # Below the voltage limits of both families, 3.5 and 4 V.
    (_set("volts", 3.4), "switched itself off: its voltage is out of range"),
    (_breaks("overload"), "switched itself off: it is overloaded"),
    (_breaks("mute"), "does not answer, 5 cycles in a row"),
    (_breaks("deaf"), "does not answer, 5 cycles in a row"),
    (lambda rig: rig.port.late_ns.update({3: 8_000_000}), "answers too late, 5 cycles in a row"),
    (lambda rig: rig.port.damaged.add(3), "does not answer, 5 cycles in a row"),
]


@pytest.mark.parametrize(
    ("family", "fault", "text"),
    [
        *(("Dynamixel", *case) for case in (*_FAULTS, _SNAPPED)),
        *(("Feetech", *case) for case in _FAULTS),
    ],
)
def test_a_fault_of_one_servo_stops_all(family: str, fault: _Fault, text: str) -> None:
    rig = Rig(of(family)).start()
    rig.run(14.0, 20)
    fault(rig)
    reason = rig.until("stopping")
    assert rig.faulty == ["EIP"]
    assert reason.startswith("Servo EIP (id 3) ")
    assert text in reason
    with pytest.raises(RobotError, match=r"cannot be held: Servo EIP \(id 3\)"):
        rig.bus.hold()
    rig.run(None)
    # The faulty servo has released; the others have begun to ramp down.
    if not rig.twin("EIP").deaf:
        assert rig.twin("EIP").pulls_a == 0.0
    assert rig.twin("FDP").pulls_a > 0.05
    rig.run(None, 40)
    if rig.bus.mode == "silent":
        text = "EIP did not confirm the release, so no packet is sent any more"
        assert text in rig.bus.reason
        sent = len(rig.port.sent)
        rig.run(None, 3)
        assert len(rig.port.sent) == sent
    else:
        assert rig.bus.mode == "off"
    rig.line.advance(100_000_000)  # The watchdogs of unreachable servos expire.
    if family == "Feetech" and rig.twin("EIP").deaf:
        assert rig.twin("EIP").pulls_a > 0.0
        rig.line.set_power(on=False)
    assert rig.pulls() == [0.0] * 7


def test_a_short_silence_is_tolerated() -> None:
    """Servos behind a silent one are read in a second packet, with few retries."""
    rig = Rig().start()
    rig.run(4.0, 3)
    rig.twin("FDS").mute = True
    rig.port.sent.clear()
    assert set(rig.run(4.0, 4)) == set(NAMES) - {"FDS"}
    assert [len(p) for p in rig.port.sent if p[7:9] == b"\x82\x7e"] == [21, 19] + [20, 15] * 3
    assert rig.bus.mode == "held"
    rig.twin("FDS").mute = False
    assert set(rig.run(4.0, 3)) == set(NAMES)
    assert rig.bus.reason == ""


def test_three_mute_servos_are_each_found() -> None:
    rig = Rig().start()
    for name in ("FDP", "EDC", "PI"):
        rig.twin(name).mute = True
    rig.run(4.0, 8)
    assert rig.faulty == ["FDP", "EDC", "PI"]


@pytest.mark.parametrize(
    ("most_missed", "text"),
    [
        (50, "has restarted, for example after a dip of its power, and lost its zero"),
        (5, "does not answer, 5 cycles in a row"),
    ],
)
def test_a_power_dip_invalidates_the_zero(
    most_missed: int, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The servo reports no length, and the robot cannot be armed until its zero is found."""
    monkeypatch.setattr("shapechanger.robot.drivers.servos.servo._MOST_MISSED", most_missed)
    rig = Rig().start()
    rig.run(4.0, 5)
    rig.twin("EIP").lose_power()
    seen = {}
    while "EIP" not in seen:
        seen = rig.run(4.0)
    assert "length" not in seen["EIP"]
    assert text in rig.bus.reason
    assert "length" in seen["FDP"]
    with pytest.raises(RobotError, match="EIP lost the power, and so the zero of its tendon"):
        rig.bus.ready()


def test_a_servo_with_a_hardware_error_needs_a_reboot() -> None:
    """`set_up` reports the error until the servo has been without power."""
    rig = Rig().start()
    rig.line.break_servo("EIP", "overload")
    rig.until("off")
    with pytest.raises(RobotError, match=r"EIP .* it is overloaded. Only a reboot"):
        rig.bus.set_up()
    rig.twin("EIP").lose_power()
    rig.line.advance(400_000_000)
    rig.prepare().run(4.0, 10)
    assert rig.bus.reason == ""


def test_servos_stop_without_cycles() -> None:
    """Servos stop after 100 ms without a packet, and one of the next four cycles reports why."""
    rig = Rig().start()
    rig.run(10.0, 20)
    rig.line.advance(89_000_000)
    assert min(rig.pulls()) > 0.3
    rig.line.advance(2_000_000)
    assert rig.pulls() == [0.0] * 7
    rig.run(10.0, 4)
    assert rig.faulty == list(NAMES)
    text = "was stopped by its own watchdog: it received nothing for 100 ms"
    assert rig.bus.reason.count(text) == 7
    assert rig.pulls() == [0.0] * 7
    rig.until("off")


def test_without_watchdogs_an_unplugged_adapter_ends_in_silence_at_once() -> None:
    """Feetech servos would ignore a ramp, so the power switch has to act at once."""
    rig = Rig(of("Feetech")).start()
    rig.run(20.0, 20)
    rig.port.is_gone = True
    rig.run(20.0)
    assert rig.bus.mode == "silent"
    text = "did not confirm the release, so no packet is sent any more: [enable] stops"
    assert text in rig.bus.reason
    with pytest.raises(RobotError, match="is gone"):
        rig.bus.let_go()
    rig.line.advance(10 * CYCLE_NS)
    assert min(rig.pulls()) > 0.0
    rig.line.set_power(on=False)
    assert rig.pulls() == [0.0] * 7


def test_an_unplugged_adapter_is_reported_and_trips_the_watchdogs() -> None:
    """When the serial device raises on every call, the cycle reports it and does not raise."""
    rig = Rig().start()
    rig.run(10.0, 20)
    rig.port.is_gone = True
    rig.run(10.0)
    assert rig.bus.reason.startswith("The bus at the twin is gone: ")
    assert rig.bus.mode == "stopping"
    rig.line.advance(10 * CYCLE_NS)
    assert rig.pulls() == [0.0] * 7
    rig.until("silent")


@pytest.mark.parametrize(
    ("deaf_for", "text"),
    [
        (102, "Servo PI (id 7) has a goal of 136 counts, and was sent 273"),  # Goal current.
        (64, "Servo PI (id 7) has let go by itself."),  # Torque enable.
    ],
)
def test_a_goal_or_torque_that_is_not_in_effect_is_reported(
    deaf_for: int, text: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Sync writes have no reply, so the driver reads goals and torque back periodically."""
    rig = Rig().start()
    rig.run(4.0, 4)
    servo = rig.twin("PI")
    taken = servo.write
    if deaf_for == 64:
        servo.write(64, b"\0")

    def deaf(at: int, data: bytes) -> ServoReply:
        return ServoReply(0, b"") if at == deaf_for else taken(at, data)

    monkeypatch.setattr(servo, "write", deaf)
    rig.run(8.0, 8)
    assert text in rig.bus.reason


def _feetech(servo_id: int, error: int, data: bytes = b"") -> bytes:
    return status(servo_id, error, data, FEETECH)


_ids = st.integers(0, 255)
# Random bytes rarely form a packet, so include valid packets with random content and cut ones.
_noise = st.one_of(
    st.binary(max_size=60),
    st.builds(pack, _ids, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(status, _ids, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(lambda p, n: p[:n], st.builds(status, _ids, st.just(0)), st.integers(0, 11)),
    st.binary(min_size=3, max_size=9).map(lambda tail: b"\xff\xff\xfd\x00" + tail),
    st.builds(_feetech, _ids, st.integers(0, 255), st.binary(max_size=40)),
    st.builds(lambda p, n: p[:n], st.builds(_feetech, _ids, st.just(0)), st.integers(0, 6)),
    st.binary(min_size=1, max_size=9).map(lambda tail: b"\xff\xff" + tail),
)
_slow = examples(max_examples=20, suppress_health_check=[HealthCheck.too_slow])


@pytest.mark.parametrize("family", ["Dynamixel", "Feetech"])
@_slow
@given(noise=st.lists(_noise, max_size=5), tension=st.floats(-50, 50))
def test_noise_never_breaks_the_driver_or_its_caps(
    family: str, noise: list[bytes], tension: float
) -> None:
    """`set_up` succeeds or raises a full sentence, and no servo pulls more than its cap."""
    rig, errors = Rig(of(family)), list[str]()
    for data in noise[:2]:
        rig.port.inject(data)
        try:
            rig.bus.set_up()
        except RobotError as error:
            errors.append(str(error))
    assert all(one.endswith(".") for one in errors)
    rig.start()
    first = rig.settings.servos[0]
    cap = first.most_counts * first.known.ampere_per_goal
    for data in noise:
        rig.port.inject(data)
        seen = rig.run(tension)
        assert all(0.0 <= one <= cap for one in rig.pulls())
        assert all(math.isfinite(x) for found in seen.values() for x in found.values())
    rig.bus.close()
