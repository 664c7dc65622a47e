"""Each rule of the guard, to the nanosecond, with explicit times."""

from dataclasses import replace
from itertools import pairwise

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, LimitPlan, SensorPlan, StopPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.guard.rules import RobotHealth, Rules, Stopping
from shapechanger.robot.guard.sensors import Sensing
from tests.robot.guard.plans import MS, arm, car, command, quick_car

_T0 = 5_000 * MS


def _armed(plan: GuardPlan) -> Rules:
    rules = Rules(plan, _T0)
    assert not rules.offer(arm(_T0), _T0)
    return rules


def _driving(plan: GuardPlan, values: tuple[float, ...] = (0.5, 0.5)) -> Rules:
    rules = _armed(plan)
    assert not rules.offer(command(1, _T0, values, frame_ns=_T0), _T0)
    assert rules.tick(_T0).actions == values
    return rules


def test_a_new_guard_is_not_armed() -> None:
    rules = Rules(quick_car(), _T0)
    assert rules.senses == Sensing()
    assert RobotHealth(quick_car()).reason == ""
    assert "Not armed" in rules.offer(command(1, _T0), _T0)
    decision = rules.tick(_T0)
    assert decision.session == 0
    assert decision.actions == (0.0, 0.0)
    assert decision.seq is None
    assert decision.stop_reason == "Not armed."


def test_a_command_ends_exactly_at_its_deadline() -> None:
    rules = _armed(quick_car())
    assert rules.tick(_T0).stop_reason == "No fresh command."
    assert not rules.offer(command(1, _T0 - 10 * MS), _T0)
    end = _T0 + 240 * MS
    assert rules.next_wake_ns(end - 1) == end
    last = rules.tick(end - 1)
    assert (last.actions, last.seq, last.session, last.stop_reason) == ((0.5, 0.5), 1, 1, "")
    assert last.release is False
    assert rules.tick(end).actions == (0.0, 0.0)
    assert rules.tick(end).stop_reason == "No fresh command."


def test_a_robot_stands_unless_a_command_may_act() -> None:
    rules = Rules(quick_car(), _T0)
    assert rules.stands(_T0)
    rules = _driving(quick_car())
    assert [rules.stands(_T0 + 250 * MS - left) for left in (1, 0)] == [False, True]


def test_times_slightly_in_the_future_count_from_now() -> None:
    rules = _armed(quick_car())
    assert not rules.offer(command(1, _T0 + 50 * MS), _T0)
    assert [rules.tick(_T0 + 250 * MS - left).seq for left in (1, 0)] == [1, None]
    rules = _armed(quick_car(LimitPlan(camera_stale_ms=100)))
    rules.offer(command(1, _T0, frame_ns=_T0 + 50 * MS), _T0)
    assert [rules.tick(_T0 + 100 * MS - left).seq for left in (1, 0)] == [1, None]


@pytest.mark.parametrize(
    ("order", "text"),
    [
        (command(5, _T0, session=2), "not newer"),
        (command(4, _T0, session=2), "not newer"),
        (command(9, _T0, session=1), "not newer"),
        (command(6, _T0 + 51 * MS, session=2), "future"),
        (command(6, _T0 - 250 * MS, session=2), "250 ms old"),
        (command(6, _T0 - 20 * MS, session=2, ttl_ms=20), "20 ms old"),
        (command(6, _T0, session=2, ttl_ms=0), "0 ms old"),
    ],
)
def test_stale_commands_are_refused(order: Order, text: str) -> None:
    rules = _armed(quick_car())
    assert not rules.offer(command(5, _T0, session=2), _T0)
    assert text in rules.offer(order, _T0)
    assert rules.tick(_T0).seq == 5


def test_an_emergency_stop_latches_until_acknowledged() -> None:
    rules = _driving(quick_car())
    rules.offer(Order("emergency", reason="a child."), _T0)
    rules.offer(Order("emergency"), _T0)
    assert rules.tick(_T0).stop_reason == "Emergency stop: a child."
    assert rules.emergencies == 2
    rules.offer(Order("disarm", reason="the lease was lost."), _T0)
    assert rules.tick(_T0).stop_reason == "Emergency stop: a child."
    for seen in (0, 1, 3):
        assert "2 emergency stops" in rules.offer(arm(_T0, seen), _T0)
    refusal = rules.offer(arm(_T0, 2, person=False), _T0)
    assert refusal == "Not armed: only a person ends an emergency stop."
    refusal = rules.offer(command(2, _T0), _T0)
    assert refusal == "Command 2 is refused. Emergency stop: a child."
    assert not rules.offer(arm(_T0, 2), _T0)
    assert rules.tick(_T0).seq is None
    assert not rules.offer(command(3, _T0), _T0)
    assert rules.tick(_T0).seq == 3
    rules.offer(Order("disarm", reason="the lease was lost."), _T0)
    assert rules.tick(_T0).stop_reason == "Disarmed: the lease was lost."
    rules.stop("")
    assert rules.tick(_T0).stop_reason == "Emergency stop."


def test_reasons_are_truncated() -> None:
    rules = _driving(quick_car())
    rules.disarm("\N{GRINNING FACE}" * 1024)
    assert len(rules.tick(_T0).stop_reason.encode()) < 250
    rules.stop("\ud800" * 1024)
    assert len(rules.tick(_T0).stop_reason.encode()) < 250


def test_a_pressed_button_stops_and_prevents_arming() -> None:
    rules = _driving(quick_car())
    rules.press(True)
    rules.press(True)
    assert rules.emergencies == 1
    assert "button" in rules.offer(arm(_T0, 1), _T0)
    rules.press(False)
    assert rules.tick(_T0).stop_reason == "Emergency stop: the button was pressed."
    assert not rules.offer(arm(_T0, 1), _T0)


def test_values_stay_within_the_caps() -> None:
    rules = _driving(quick_car(), (0.0, 0.0))
    rules.offer(command(2, _T0, (-9.0, 9)), _T0)
    decision = rules.tick(_T0)
    assert decision.actions == (-0.8, 0.6)
    assert decision.stop_reason == "Clipped by the robot's caps."
    rules.offer(command(3, _T0, (-0.800000011920929, 0.6000000238418579)), _T0)
    assert rules.tick(_T0).stop_reason == ""  # Rounding to 32 bits is not clipping.


def test_an_action_that_rests_outside_its_caps_is_refused() -> None:
    action = ActionPlan("throttle", 0.2, 0.6)
    with pytest.raises(RobotError, match="'throttle' rests at 0, outside its caps"):
        Rules(replace(car(), actions=(action,)), 0)


def test_slew_limits_moves_away_from_rest_only() -> None:
    rules = _armed(car())

    def at(ms: int, throttle: float) -> float:
        rules.offer(command(ms, _T0 + ms * MS, (0.0, throttle)), _T0 + ms * MS)
        return rules.tick(_T0 + ms * MS).actions[1]

    assert at(10, 0.5) == pytest.approx(0.02)
    assert at(20, 0.5) == pytest.approx(0.04)
    assert at(25, 0.05) == pytest.approx(0.05)
    assert at(30, 0.01) == 0.01
    assert at(40, -0.4) == 0.0
    assert at(50, -0.4) == pytest.approx(-0.02)
    assert at(60, 0.4) == 0.0


def test_a_tension_falls_no_faster_than_it_rises() -> None:
    tension = ActionPlan("FDP", 0.0, slew_per_s=20.0, slew_down_per_s=20.0, one_sided=True)
    rules = _armed(replace(car(stop=StopPlan(hold_ms=0, ramp_ms=40)), actions=(tension,)))
    seen: list[float] = []
    for k in range(40):
        now = _T0 + (k + 1) * 20 * MS
        rules.offer(command(k, now, (0.3 + 0.4 * (k % 2),)), now)
        seen += [rules.tick(now + ms * MS).actions[0] for ms in (0, 10)]
    steps = [abs(after - before) for before, after in pairwise(seen)]
    assert max(steps) <= 0.2 + 1e-9
    assert sum(seen[20:]) / len(seen[20:]) == pytest.approx(0.5, abs=0.01)
    rules.tick(now + 300 * MS)  # Out of date.
    assert rules.tick(now + 340 * MS).actions == (0.0,)


def test_slew_is_limited_after_a_pause() -> None:
    rules = _armed(car())
    later = _T0 + 10_000 * MS
    rules.offer(command(1, later, (0.0, 0.6)), later)
    assert rules.tick(later).actions[1] == pytest.approx(0.04)


def test_three_levels() -> None:
    steering = ActionPlan("steering", -0.4, 0.4, slew_per_s=1.0, levels="three", threshold=0.3)
    rules = _armed(replace(car(), actions=(steering,)))
    seen: list[float] = []
    for seq, value in enumerate((0.29, 0.3, 1.0, -0.2, -0.3, 0.9, 0.9)):
        rules.offer(command(seq, _T0, (value,)), _T0)
        seen.append(rules.tick(_T0).actions[0])
    assert seen == [0.0, 0.4, 0.4, 0.0, -0.4, 0.0, 0.4]


def test_a_stop_holds_and_ramps_what_does_not_propel() -> None:
    rules = _driving(quick_car(stop=StopPlan(hold_ms=100, ramp_ms=200, then="release")))
    rules.disarm("")
    assert rules.tick(_T0).actions == (0.5, 0.0)
    assert rules.next_wake_ns(_T0 + 95 * MS) == _T0 + 100 * MS
    rules.stop("")  # A second stop does not restart the ramp.
    assert rules.tick(_T0 + 100 * MS).actions == (0.5, 0.0)
    assert rules.tick(_T0 + 200 * MS).actions == (pytest.approx(0.25), 0.0)
    assert not rules.tick(_T0 + 300 * MS - 1).release
    end = rules.tick(_T0 + 300 * MS)
    assert end.actions == (0.0, 0.0)
    assert end.release
    assert rules.next_wake_ns(_T0 + 300 * MS) == _T0 + 310 * MS


def test_a_new_guard_starts_released() -> None:
    rules = Rules(quick_car(stop=StopPlan(hold_ms=100, then="release")), _T0)
    assert rules.tick(_T0).release
    rules.offer(arm(_T0), _T0)
    rules.offer(command(1, _T0), _T0)
    assert not rules.tick(_T0).release


def test_an_output_that_fails_stops_everything_without_hold() -> None:
    rules = _driving(quick_car(stop=StopPlan(hold_ms=100)))
    rules.fail("Output drive: no answer", _T0)
    decision = rules.tick(_T0)
    assert decision.actions == (0.0, 0.0)
    assert decision.stop_reason == "Emergency stop: Output drive: no answer"


def test_a_stale_frame_stops_the_robot() -> None:
    rules = _armed(quick_car(LimitPlan(camera_stale_ms=100)))
    rules.offer(command(1, _T0), _T0)
    assert rules.tick(_T0).stop_reason == "Blind: no image yet."
    rules.offer(command(2, _T0, frame_ns=_T0 + 51 * MS), _T0)
    assert rules.tick(_T0).seq is None  # A frame from the future is ignored.
    rules.offer(command(3, _T0, frame_ns=_T0 - 40 * MS), _T0)
    rules.offer(command(4, _T0, frame_ns=_T0 - 90 * MS), _T0)
    end = _T0 + 60 * MS
    assert rules.next_wake_ns(end - 1) == end
    assert rules.tick(end - 1).seq == 4
    assert rules.tick(end).stop_reason == "Blind: no image for 100 ms."
    rules.offer(command(5, end, frame_ns=end), end)
    assert rules.tick(end).seq == 5


def test_without_a_command_no_stale_frame_is_reported() -> None:
    rules = _armed(quick_car(LimitPlan(camera_stale_ms=100)))
    assert rules.tick(_T0).stop_reason == "No fresh command."
    rules.offer(command(1, _T0, frame_ns=_T0), _T0)
    assert rules.tick(_T0 + 300 * MS).stop_reason == "No fresh command."


def _sense(rules: Rules, now_ns: int, **quantities: float) -> None:
    names = {"bump": "bumper", "speed": "wheel", "distance": "eye", "battery": "meter"}
    sources = {name: names.get(name, "else") for name in quantities}
    rules.sense(Sensing(quantities, sources), now_ns)


def _ask(rules: Rules, seq: int, now_ns: int, throttle: float) -> tuple[float, str]:
    assert not rules.offer(command(seq, now_ns, (0.5, throttle)), now_ns)
    decision = rules.tick(now_ns)
    assert decision.actions[0] == 0.5
    return decision.actions[1], decision.stop_reason


def test_a_bump_prevents_driving_forward() -> None:
    rules = _driving(quick_car())
    text = "Not forward: the bumper touched something."
    _sense(rules, _T0, bump=1.0)
    assert _ask(rules, 2, _T0, 0.5) == (0.0, text)
    _sense(rules, _T0 + 10 * MS, bump=1.0)
    assert _ask(rules, 3, _T0 + 10 * MS, -0.3) == (-0.3, "")
    _sense(rules, _T0 + 20 * MS, bump=0.0)
    free = _T0 + 760 * MS
    assert _ask(rules, 4, free - 1, 0.5) == (0.0, text)
    assert rules.next_wake_ns(free - 1) == free
    assert _ask(rules, 5, free, 0.5) == (0.5, "")
    assert rules.bumps == 1
    _sense(rules, free, bump=1.0)
    assert rules.bumps == 2


def test_a_near_obstacle_prevents_driving_forward() -> None:
    rules = _driving(quick_car(LimitPlan(stop_distance_m=0.3)))
    _sense(rules, _T0, distance=0.29)
    assert _ask(rules, 2, _T0, 0.5) == (0.0, "Not forward: something is near.")
    assert _ask(rules, 3, _T0, -0.4) == (-0.4, "")
    _sense(rules, _T0, distance=0.3)
    assert _ask(rules, 4, _T0, 0.5) == (0.0, "")  # Through rest.
    assert _ask(rules, 5, _T0, 0.5) == (0.5, "")
    other = _driving(quick_car())
    _sense(other, _T0, distance=0.01)
    assert _ask(other, 2, _T0, 0.5) == (0.5, "")


@pytest.mark.parametrize(
    "sensing",
    [Sensing(), Sensing({"distance": 2.0}, {"distance": "eye"}, silent={"other"})],
)
def test_an_unknown_distance_prevents_driving_forward(sensing: Sensing) -> None:
    rules = _driving(quick_car(LimitPlan(stop_distance_m=0.3)))
    rules.sense(sensing, _T0)
    assert _ask(rules, 2, _T0, 0.5) == (0.0, "Not forward: the distance ahead is not known.")
    assert _ask(rules, 3, _T0, -0.4) == (-0.4, "")
    _sense(rules, _T0, distance=2.0)
    assert _ask(rules, 4, _T0, 0.0) == (0.0, "")
    assert _ask(rules, 5, _T0, 0.5) == (0.5, "")
    other = _driving(quick_car())
    other.sense(sensing, _T0)
    assert _ask(other, 2, _T0, 0.5) == (0.5, "")


def test_a_controller_at_neutral_does_not_stall() -> None:
    rules = _driving(quick_car())
    for ms in range(0, 1_000, 10):
        now_ns = _T0 + ms * MS
        assert _ask(rules, 2 + ms, now_ns, 0.5) == (0.5, "")
        rules.learn((0.5, 0.0))
        assert rules.direction == 0.0
        _sense(rules, now_ns, speed=0.0)
    assert rules.senses.quantities["stall"] == 0.0


@pytest.mark.parametrize("name", ["wheel", "bumper"])
def test_a_slow_sensor_stops_whatever_it_measures(name: str) -> None:
    rules = _driving(quick_car())
    rules.sense(Sensing(failures={name: "Slow."}, slow={name}), _T0)
    decision = rules.tick(_T0)
    assert decision.seq is None
    assert decision.stop_reason == f"Sensor {name} holds up the robot: Slow."


@pytest.mark.parametrize(("throttle", "way"), [(0.5, "forward"), (-0.4, "backward")])
def test_a_stall_stops_until_another_command(throttle: float, way: str) -> None:
    rules = _driving(quick_car(), (0.5, throttle))
    text = f"Not {way}: it pushes and does not move."
    _sense(rules, _T0, speed=0.0)
    _sense(rules, _T0 + 400 * MS - 1, speed=0.0)
    later = _T0 + 400 * MS
    assert _ask(rules, 2, later - 1, throttle) == (throttle, "")
    _sense(rules, later, speed=0.0)
    assert rules.senses.quantities == {"speed": 0.0, "stall": 1.0, "collision": 1.0}
    assert rules.senses.sources == {"speed": "wheel", "stall": "wheel", "collision": "estimated"}
    assert _ask(rules, 3, later, throttle) == (0.0, text)
    _sense(rules, later + MS, speed=0.0)
    assert _ask(rules, 4, later + MS, throttle) == (0.0, text)
    assert _ask(rules, 5, later + MS, -throttle / 2) == (-throttle / 2, "")
    assert _ask(rules, 6, later + MS, throttle) == (0.0, "")  # Through rest.
    assert _ask(rules, 7, later + MS, throttle) == (throttle, "")


def test_a_stall_ends_while_the_robot_stands() -> None:
    rules = _driving(quick_car())
    for ms in (0, 400):
        _sense(rules, _T0 + ms * MS, speed=0.0)
    later = _T0 + 400 * MS
    assert _ask(rules, 2, later, 0.5)[0] == 0.0
    rules.halt()
    rules.tick(later)
    assert _ask(rules, 3, later, 0.5) == (0.5, "")


def test_no_stall_while_moving_or_at_low_throttle() -> None:
    rules = _driving(quick_car())
    for ms in range(0, 4_000, 100):
        _sense(rules, _T0 + ms * MS, speed=0.2 if ms % 300 == 0 else 0.0)
    assert rules.senses.quantities["stall"] == 0.0
    _sense(rules, _T0)
    assert rules.senses.quantities == {}
    _ask(rules, 2, _T0, 0.2)
    for ms in range(0, 4_000, 100):
        _sense(rules, _T0 + ms * MS, speed=0.0)
    assert rules.senses.quantities["stall"] == 0.0


@pytest.mark.parametrize(("name", "bad"), [("battery", 6.3), ("temperature", 80.5)])
def test_a_low_battery_and_a_hot_computer_count_after_half_a_second(name: str, bad: float) -> None:
    limits = LimitPlan(low_battery_v=6.4, high_temperature_c=80.0, stall_s=0.0)
    half_a_second = 500 * MS
    for after_ns, stops in ((half_a_second - 1, False), (half_a_second, True)):
        rules = _driving(quick_car(limits))
        _sense(rules, _T0, **{name: bad})
        _sense(rules, _T0 + after_ns, **{name: bad})
        rules.offer(command(2, _T0 + after_ns), _T0 + after_ns)
        assert bool(rules.tick(_T0 + after_ns).stop_reason) is stops


def test_a_low_battery_stops_until_it_is_full_and_armed_again() -> None:
    rules = _driving(quick_car(LimitPlan(low_battery_v=6.4)))
    for ms in (0, 400, 500, 999, 1_000):  # It is believed after 500 ms without interruption.
        assert rules.tick(_T0 + ms * MS).stop_reason in ("", "No fresh command.")
        _sense(rules, _T0 + ms * MS, battery=6.4 if ms == 400 else 6.05)
    text = "The battery has 6.05 V, less than 6.4 V."
    later = _T0 + 1_010 * MS
    assert rules.tick(later).stop_reason == text
    rules.offer(arm(later), later)
    assert rules.tick(later).stop_reason == text
    _sense(rules, later, battery=6.4)
    assert rules.tick(later).stop_reason == text
    rules.offer(arm(later), later)
    assert _ask(rules, 2, later, 0.5) == (0.5, "")


def test_a_hot_computer_rests_until_it_has_cooled() -> None:
    rules = _driving(quick_car(LimitPlan(high_temperature_c=80.0)))
    _sense(rules, _T0, temperature=81.0)
    later = _T0 + 500 * MS
    _sense(rules, later, temperature=82.0)
    assert rules.tick(later).stop_reason == "The computer has 82 C, more than 80 C."
    _sense(rules, later, temperature=80.0)
    assert _ask(rules, 2, later, 0.5) == (0.5, "")


@pytest.mark.parametrize(
    ("name", "limits", "stops"),
    [
        ("bumper", LimitPlan(), True),
        ("wheel", LimitPlan(), False),
        ("eye", LimitPlan(), False),
        ("eye", LimitPlan(stop_distance_m=0.2), True),
        ("meter", LimitPlan(), False),
        ("meter", LimitPlan(low_battery_v=6.0), True),
        ("chip", LimitPlan(), False),
        ("meter", LimitPlan(low_battery_v=0.5), True),
        ("chip", LimitPlan(high_temperature_c=80.0), True),
        ("chip", LimitPlan(high_temperature_c=0.5), True),
    ],
)
def test_a_failed_protective_sensor_stops(name: str, limits: LimitPlan, stops: bool) -> None:
    rules = _driving(quick_car(limits))
    rules.sense(Sensing(failures={name: "No answer."}), _T0)
    decision = rules.tick(_T0)
    assert (decision.seq is None) == stops
    if stops:
        assert decision.stop_reason == (
            f"Sensor {name} fails, and can protect no longer: No answer."
        )
    rules.sense(Sensing(), _T0)
    assert rules.tick(_T0).seq == 1


def test_an_unmeasured_speed_is_estimated() -> None:
    plan = quick_car()
    steering, throttle = plan.actions
    plan = replace(plan, actions=(steering, replace(throttle, unit="m/s", gain=3.0)))
    rules = _driving(plan)
    _sense(rules, _T0)
    assert rules.senses.quantities == {"speed": 1.5}
    assert rules.senses.sources == {"speed": "estimated"}
    _sense(rules, _T0, speed=1.0)
    assert rules.senses.quantities["speed"] == 1.0


@pytest.mark.parametrize(
    ("sensed", "collision", "source"),
    [
        ({"bump": 1.0}, 1.0, "bumper"),
        ({"bump": 0.0, "speed": 0.0}, 0.0, "bumper"),
        ({"speed": 1.0}, 0.0, "estimated"),
    ],
)
def test_a_collision_names_its_source(
    sensed: dict[str, float], collision: float, source: str
) -> None:
    rules = _driving(quick_car())
    _sense(rules, _T0, **sensed)
    assert rules.senses.quantities["collision"] == collision
    assert rules.senses.sources["collision"] == source


def test_the_direction_is_that_of_the_propulsion() -> None:
    rules = _driving(quick_car())
    assert rules.direction == 1.0
    _ask(rules, 2, _T0, 0.0)
    assert rules.direction == 0.0
    _ask(rules, 3, _T0, -0.3)
    assert rules.direction == -1.0
    tank = replace(car(), actions=(ActionPlan("steering", propels=True),))
    turning = _driving(tank, (0.5,))
    assert turning.direction == 0.0
    _sense(turning, _T0, bump=1.0)
    assert turning.tick(_T0).actions == (0.5,)
    turning.disarm("")
    assert turning.tick(_T0).actions == (0.0,)


@pytest.mark.parametrize("measures", ["tendons", "joints"])
@pytest.mark.parametrize(("slow", "armed"), [(False, False), (True, True)])
def test_servos_that_fail_disarm_and_slow_ones_only_stop(
    slow: bool, armed: bool, measures: str
) -> None:
    plan = replace(quick_car(), sensors=(SensorPlan("spools", "bus_servo", measures),))
    rules = _driving(plan)
    late = {"spools"} if slow else set[str]()
    rules.sense(Sensing(failures={"spools": "Overload."}, slow=late), _T0)
    assert rules.armed is armed
    assert rules.disarmed == ("" if armed else "Disarmed: Overload.")
    assert rules.tick(_T0).actions == (0.0, 0.0)
    rules.offer(arm(_T0), _T0)
    rules.offer(command(2, _T0), _T0)
    assert rules.tick(_T0).stop_reason.endswith(": Overload.")


def test_a_stall_is_a_collision_even_where_no_bumper_touches() -> None:
    sensing = Sensing({"bump": 0.0, "speed": 0.0}, {"bump": "bumper", "speed": "wheel"})
    sensing.conclude(speed=None, stalled=True)
    assert (sensing.quantities["collision"], sensing.sources["collision"]) == (1.0, "estimated")


def test_a_limit_of_0_is_none_and_small_ones_count() -> None:
    """Half a second later; a temperature that nothing measures is no high one."""
    for limits, quantities, reason in (
        (LimitPlan(), {"battery": -1.0, "temperature": 90.0}, ""),
        (LimitPlan(high_temperature_c=80.0), {}, ""),
        (
            LimitPlan(low_battery_v=0.8),
            {"battery": 0.5},
            "The battery has 0.50 V, less than 0.8 V.",
        ),
        (
            LimitPlan(high_temperature_c=0.8),
            {"temperature": 2.0},
            "The computer has 2 C, more than 0.8 C.",
        ),
    ):
        health = RobotHealth(quick_car(limits))
        for now_ns in (_T0, _T0 + 500 * MS):
            health.sense(Sensing(quantities), now_ns)
        assert health.reason == reason


def test_refusals_to_arm_say_why() -> None:
    rules = Rules(quick_car(), _T0)
    assert rules.offer(arm(_T0 - 1_500 * MS), _T0) == ("Not armed: the order to arm is 1.5 s old.")
    rules.press(True)
    assert rules.offer(arm(_T0, 1), _T0) == "Not armed: the emergency button is pressed."


def test_the_end_of_the_guard_disarms() -> None:
    rules = _driving(quick_car())
    assert rules.offer(Order("end"), _T0) == ""
    assert rules.disarmed == "Disarmed: the guard ends."


def test_an_action_may_rest_at_its_cap_and_moves_by_its_slew() -> None:
    """At 2 a second, 0.02 in 10 ms, exactly."""
    plan = car()
    one = replace(plan.actions[1], low=-0.5, high=0.0)
    rules = _armed(replace(plan, actions=(plan.actions[0], one)))
    rules.tick(_T0)
    rules.offer(command(1, _T0, (0.0, -0.4)), _T0)
    assert rules.tick(_T0 + 10 * MS).actions == (0.0, -0.02)


def test_a_stop_without_a_ramp_holds_until_its_end() -> None:
    plan = StopPlan(hold_ms=10, ramp_ms=0)
    stop = Stopping(plan, [ActionPlan("steering")], [0.5], _T0)
    end = _T0 + 10 * MS
    assert [stop.values(at_ns) for at_ns in (end - 1, end)] == [(0.5,), (0.0,)]
