"""Each rule of the guard, to the nanosecond, with explicit times.

`test_rules_stateful.py` checks orders, deadlines, caps and slew under random orders.
"""

from dataclasses import replace
from itertools import pairwise

import pytest

from shapechanger.contract.plan import ActionPlan, GuardPlan, LimitPlan, SensorPlan, StopPlan
from shapechanger.errors import RobotError
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.guard.rules import OutputDecision, Rules
from shapechanger.robot.guard.sensors import Sensing
from tests.robot.guard.plans import MS, arm, car, command, quick_car

_T0 = 5_000 * MS
_SOURCES = {"bump": "bumper", "speed": "wheel", "distance": "eye", "battery": "meter"}


class _Armed:
    """An armed robot: its rules, its time and the numbers of its commands.

    Its times are milliseconds after the start.
    """

    def __init__(self, plan: GuardPlan | None = None) -> None:
        self.rules = Rules(plan or quick_car(), _T0)
        self.now_ns = _T0
        self.seq = 0
        self.arm()

    def arm(self) -> None:
        assert self.rules.offer(arm(self.now_ns, self.rules.emergencies), self.now_ns) == ""

    def wait(self, ms: float) -> None:
        self.now_ns += round(ms * MS)

    def order(self, *values: float, age_ms: int = 0, frame_age_ms: int | None = None) -> str:
        """Send a command, and return why it is refused."""
        self.seq += 1
        frame_ns = None if frame_age_ms is None else self.now_ns - frame_age_ms * MS
        issued_ns = self.now_ns - age_ms * MS
        order = command(self.seq, issued_ns, values or (0.5, 0.5), frame_ns=frame_ns)
        return self.rules.offer(order, self.now_ns)

    def tick(self) -> OutputDecision:
        return self.rules.tick(self.now_ns)

    def ask(self, throttle: float) -> tuple[float, str]:
        """Command a throttle, and return the applied throttle and the stop reason."""
        assert self.order(0.5, throttle) == ""
        decision = self.tick()
        assert decision.actions[0] == 0.5
        return decision.actions[1], decision.stop_reason

    def change(self, at_ms: float) -> tuple[OutputDecision, OutputDecision]:
        """Return the decisions 1 ns before a wake time of the rules, and at this time."""
        self.now_ns = _T0 + round(at_ms * MS) - 1
        assert self.rules.next_wake_ns(self.now_ns) == self.now_ns + 1
        before = self.tick()
        self.now_ns += 1
        return before, self.tick()

    def sense(self, **quantities: float) -> dict[str, float]:
        sources = {name: _SOURCES.get(name, "else") for name in quantities}
        self.rules.sense(Sensing(quantities, sources), self.now_ns)
        return self.rules.senses.quantities


def _driving(plan: GuardPlan | None = None, *values: float) -> _Armed:
    robot = _Armed(plan)
    assert robot.order(*values, frame_age_ms=0) == ""
    assert robot.tick().actions == (values or (0.5, 0.5))
    return robot


def test_a_new_guard_is_released_and_not_armed() -> None:
    rules = Rules(quick_car(stop=StopPlan(hold_ms=100, then="release")), _T0)
    assert rules.senses == Sensing()
    assert "Not armed" in rules.offer(command(1, _T0), _T0)
    assert rules.tick(_T0) == OutputDecision((0.0, 0.0), True, "Not armed.", 0, None)
    rules.offer(arm(_T0), _T0)
    assert rules.offer(command(2, _T0), _T0) == ""
    assert rules.tick(_T0) == OutputDecision((0.5, 0.5), False, "", 1, 2)


def test_a_command_ends_exactly_at_its_deadline() -> None:
    robot = _Armed()
    assert robot.tick().stop_reason == "No fresh command."
    assert robot.order(age_ms=10) == ""
    before, after = robot.change(240)
    assert (before.actions, before.seq, before.stop_reason) == ((0.5, 0.5), 1, "")
    assert (after.actions, after.seq, after.stop_reason) == ((0.0, 0.0), None, "No fresh command.")
    assert robot.rules.next_wake_ns(robot.now_ns) > robot.now_ns
    late = "Command 2 is 251 ms old; it may act for 250 ms."
    assert robot.order(age_ms=251) == late
    robot = _driving()
    assert [robot.rules.stands(_T0 + 250 * MS - left) for left in (1, 0)] == [False, True]


def test_an_emergency_stop_keeps_its_first_reason() -> None:
    """Refusals to move or to arm give the reason."""
    robot = _driving()
    rules = robot.rules
    for order in (Order("emergency", reason="a child."), Order("emergency"), Order("disarm")):
        rules.offer(order, _T0)
    assert robot.tick().stop_reason == "Emergency stop: a child."
    assert "Emergency stop: a child." in robot.order()
    assert "2 emergency stops" in rules.offer(arm(_T0, 1), _T0)
    only = "Not armed: only a person ends an emergency stop."
    assert rules.offer(arm(_T0, 2, person=False), _T0) == only
    assert "1.5 s old" in rules.offer(arm(_T0 - 1_500 * MS, 2), _T0)
    robot.arm()
    assert robot.ask(0.5) == (0.5, "")
    for order, reason in ((Order("disarm", reason="lost."), "lost."), (Order("end"), "the guard")):
        robot.arm()
        rules.offer(order, _T0)
        assert robot.tick().stop_reason.startswith(f"Disarmed: {reason}")
    rules.offer(Order("disarm"), _T0)
    assert robot.tick().stop_reason == "Disarmed."


def test_a_pressed_button_stops_and_prevents_arming() -> None:
    robot = _driving()
    for _ in range(2):
        robot.rules.press(True)
    assert robot.rules.emergencies == 1
    assert "button" in robot.rules.offer(arm(_T0, 1), _T0)
    robot.rules.press(False)
    assert robot.tick().stop_reason == "Emergency stop: the button was pressed."
    robot.arm()


def test_values_stay_within_the_caps() -> None:
    robot = _Armed()
    robot.order(-9.0, 9)
    decision = robot.tick()
    assert decision.actions == (-0.8, 0.6)
    assert decision.stop_reason == "Clipped by the robot's caps."
    robot.order(-0.800000011920929, 0.6000000238418579)
    assert robot.tick().stop_reason == ""  # Rounding to 32 bits is not clipping.


def test_an_action_that_rests_outside_its_caps_is_refused() -> None:
    Rules(replace(car(), actions=(ActionPlan("throttle", -0.5, 0.0),)), 0)
    action = ActionPlan("throttle", 0.2, 0.6)
    with pytest.raises(RobotError, match="'throttle' rests at 0, outside its caps"):
        Rules(replace(car(), actions=(action,)), 0)


def test_slew_limits_moves_away_from_rest_only() -> None:
    """Away from rest, by at most 2 a second and 0.04 a tick; a change of sign rests for a tick."""
    robot = _Armed(car())
    steps = ((10, 0.5, 0.02), (10, 0.5, 0.04), (5, 0.05, 0.05), (5, 0.01, 0.01))
    steps += ((10, -0.4, 0.0), (10, -0.4, -0.02), (10, 0.4, 0.0), (10_000, 0.6, 0.04))
    for wait_ms, throttle, applied in steps:
        robot.wait(wait_ms)
        robot.order(0.0, throttle)
        assert robot.tick().actions[1] == pytest.approx(applied)


def test_a_tension_falls_no_faster_than_it_rises() -> None:
    tension = ActionPlan("FDP", 0.0, slew_per_s=20.0, slew_down_per_s=20.0, one_sided=True)
    robot = _Armed(replace(car(stop=StopPlan(hold_ms=0, ramp_ms=40)), actions=(tension,)))
    seen: list[float] = []
    for k in range(40):
        for ms in (10, 10):
            robot.wait(ms)
            robot.order(0.3 + 0.4 * (k % 2))
            seen.append(robot.tick().actions[0])
    assert max(abs(after - before) for before, after in pairwise(seen)) <= 0.2 + 1e-9
    assert sum(seen[20:]) / len(seen[20:]) == pytest.approx(0.5, abs=0.01)
    for ms in (300, 40):  # The command expires, then the tension ramps to rest.
        robot.wait(ms)
        robot.tick()
    assert robot.tick().actions == (0.0,)


def test_an_action_with_three_levels_is_at_rest_or_at_a_cap() -> None:
    steering = ActionPlan("steering", -0.4, 0.4, slew_per_s=1.0, levels="three", threshold=0.3)
    robot = _Armed(replace(car(), actions=(steering,)))
    seen: list[float] = []
    for value in (0.29, 0.3, 1.0, -0.2, -0.3, 0.9, 0.9):
        robot.order(value)
        seen.append(robot.tick().actions[0])
    assert seen == [0.0, 0.4, 0.4, 0.0, -0.4, 0.0, 0.4]


def test_a_stop_holds_and_ramps_actions_that_do_not_propel() -> None:
    robot = _driving(quick_car(stop=StopPlan(hold_ms=100, ramp_ms=200, then="release")))
    robot.rules.disarm("")
    assert robot.tick().actions == (0.5, 0.0)
    robot.rules.stop("")  # A second stop does not restart the ramp.
    assert [one.actions for one in robot.change(100)] == [(0.5, 0.0)] * 2
    robot.wait(100)
    assert robot.tick().actions == (pytest.approx(0.25), 0.0)
    before, after = robot.change(300)
    assert (before.release, after.release, after.actions) == (False, True, (0.0, 0.0))
    assert robot.rules.next_wake_ns(robot.now_ns) == robot.now_ns + 10 * MS


def test_a_stop_without_a_ramp_holds_until_its_end() -> None:
    robot = _driving(quick_car(stop=StopPlan(hold_ms=10, ramp_ms=0)))
    robot.rules.disarm("")
    robot.tick()
    assert [one.actions for one in robot.change(10)] == [(0.5, 0.0), (0.0, 0.0)]


def test_an_output_that_fails_stops_everything_without_hold() -> None:
    robot = _driving(quick_car(stop=StopPlan(hold_ms=100)))
    robot.rules.fail("Output drive: no answer", _T0)
    decision = robot.tick()
    assert decision.actions == (0.0, 0.0)
    assert decision.stop_reason == "Emergency stop: Output drive: no answer"


def test_a_stale_frame_stops_the_robot() -> None:
    robot = _Armed(quick_car(LimitPlan(camera_stale_ms=100)))
    robot.order()
    assert robot.tick().stop_reason == "Blind: no image yet."
    robot.order(frame_age_ms=-51)  # A frame from the future is ignored.
    assert robot.tick().seq is None
    for age_ms in (40, 90):
        robot.order(frame_age_ms=age_ms)
    before, after = robot.change(60)
    assert (before.seq, after.stop_reason) == (4, "Blind: no image for 100 ms.")
    robot.order(frame_age_ms=-50)  # A tolerated time in the future counts from now.
    assert [one.seq for one in robot.change(160)] == [5, None]


def test_a_bump_prevents_driving_forward() -> None:
    robot = _driving()
    text = "Not forward: the bumper touched something."
    robot.sense(bump=1.0)
    assert robot.ask(0.5) == (0.0, text)
    robot.wait(10)
    robot.sense(bump=1.0)
    assert robot.ask(-0.3) == (-0.3, "")
    robot.wait(10)
    robot.sense(bump=0.0)
    robot.wait(700)
    robot.order()
    before, after = robot.change(760)
    assert (before.actions[1], before.stop_reason) == (0.0, text)
    assert (after.actions[1], after.stop_reason) == (0.5, "")
    assert robot.rules.bumps == 1
    robot.sense(bump=1.0)
    assert robot.rules.bumps == 2


_UNKNOWN = "Not forward: the distance ahead is not known."


@pytest.mark.parametrize(
    ("sensing", "reason"),
    [
        (Sensing({"distance": 0.29}, {"distance": "eye"}), "Not forward: something is near."),
        (Sensing(), _UNKNOWN),
        (Sensing({"distance": 2.0}, {"distance": "eye"}, silent={"other"}), _UNKNOWN),
    ],
)
def test_a_near_or_unknown_obstacle_prevents_driving_forward(sensing: Sensing, reason: str) -> None:
    """Without a limit in the profile, distances prevent no motion."""
    robot = _driving(quick_car(LimitPlan(stop_distance_m=0.3)))
    robot.rules.sense(sensing, _T0)
    assert robot.ask(0.5) == (0.0, reason)
    assert robot.ask(-0.4) == (-0.4, "")
    robot.sense(distance=0.3)
    assert robot.ask(0.5) == (0.0, "")  # A change of sign passes through rest.
    assert robot.ask(0.5) == (0.5, "")
    other = _driving()
    other.rules.sense(sensing, _T0)
    assert other.ask(0.5) == (0.5, "")


@pytest.mark.parametrize(("throttle", "way"), [(0.5, "forward"), (-0.4, "backward")])
def test_a_stall_stops_until_another_command(throttle: float, way: str) -> None:
    robot = _driving(None, 0.5, throttle)
    text = f"Not {way}: it pushes and does not move."
    robot.sense(speed=0.0)
    robot.now_ns += 400 * MS - 1
    robot.sense(speed=0.0)
    assert robot.ask(throttle) == (throttle, "")
    robot.now_ns += 1
    assert robot.sense(speed=0.0) == {"speed": 0.0, "stall": 1.0, "collision": 1.0}
    sources = {"speed": "wheel", "stall": "wheel", "collision": "estimated"}
    assert robot.rules.senses.sources == sources
    for _ in range(2):
        assert robot.ask(throttle) == (0.0, text)
        robot.wait(1)
        robot.sense(speed=0.0)
    assert robot.ask(-throttle / 2) == (-throttle / 2, "")
    assert robot.ask(throttle) == (0.0, "")  # A change of sign passes through rest.
    assert robot.ask(throttle) == (throttle, "")


def test_a_stall_ends_while_the_robot_stands() -> None:
    robot = _driving()
    for ms in (0, 400):
        robot.wait(ms)
        robot.sense(speed=0.0)
    assert robot.ask(0.5)[0] == 0.0
    robot.rules.halt()
    robot.tick()
    assert robot.ask(0.5) == (0.5, "")


@pytest.mark.parametrize(
    ("throttle", "done", "speeds"),
    [(0.5, 0.5, (0.2, 0.0, 0.0)), (0.2, 0.2, (0.0,)), (0.5, 0.0, (0.0,))],
    ids=["it moves", "low throttle", "its controller is at neutral"],
)
def test_no_stall_is_detected(throttle: float, done: float, speeds: tuple[float, ...]) -> None:
    robot = _driving()
    for number in range(40):
        assert robot.ask(throttle) == (throttle, "")
        robot.rules.set_applied((0.5, done))
        assert robot.sense(speed=speeds[number % len(speeds)])["stall"] == 0.0
        robot.wait(100)
    assert robot.sense() == {}


def test_the_direction_is_the_sign_of_the_propulsion() -> None:
    robot = _driving()
    for throttle, direction in ((0.5, 1.0), (0.0, 0.0), (-0.3, -1.0)):
        robot.ask(throttle)
        assert robot.rules.direction == direction
    tank = _driving(replace(car(), actions=(ActionPlan("steering", propels=True),)), 0.5)
    assert tank.rules.direction == 0.0
    tank.sense(bump=1.0)
    assert tank.tick().actions == (0.5,)
    tank.rules.disarm("")
    assert tank.tick().actions == (0.0,)


_HEALTH = LimitPlan(low_battery_v=0.8, high_temperature_c=80.0)


@pytest.mark.parametrize(
    ("limits", "name", "value", "reason"),
    [
        (_HEALTH, "battery", 0.7, "The battery has 0.70 V, less than 0.8 V."),
        (_HEALTH, "battery", 0.8, ""),
        (_HEALTH, "temperature", 82.0, "The computer has 82 C, more than 80 C."),
        (_HEALTH, "temperature", 80.0, ""),
        (
            LimitPlan(high_temperature_c=1.0),
            "temperature",
            2.0,
            "The computer has 2 C, more than 1 C.",
        ),
        (_HEALTH, "speed", 1.0, ""),
        (LimitPlan(), "battery", -1.0, ""),
        (LimitPlan(), "temperature", 90.0, ""),
    ],
)
def test_a_low_battery_and_a_hot_computer_stop_after_half_a_second(
    limits: LimitPlan, name: str, value: float, reason: str
) -> None:
    """The limit must be exceeded without interruption; a limit of 0 is not checked."""
    robot = _driving(quick_car(limits))
    for at_ms, one in ((0, value), (400, 1.0), (450, value)):
        robot.now_ns = _T0 + at_ms * MS
        robot.sense(**{name: one})
        assert robot.ask(0.5) == (0.5, "")
    for left_ns, expected in ((1, ""), (0, reason)):
        robot.now_ns = _T0 + 950 * MS - left_ns
        robot.sense(**{name: value})
        robot.order()
        assert robot.tick().stop_reason == expected


def test_a_low_battery_stops_until_it_has_recovered_and_is_armed() -> None:
    """A robot whose computer has cooled down need not be armed again."""
    robot = _driving(quick_car(_HEALTH))
    text = "The battery has 0.50 V, less than 0.8 V."
    for battery, arms, reason in ((0.5, 1, text), (0.8, 0, text), (0.8, 1, "")):
        for _ in range(2):
            robot.sense(battery=battery)
            robot.wait(500)
        if arms:
            robot.arm()
        robot.order()
        assert robot.tick().stop_reason == reason
    for celsius, reason in ((81.0, "The computer has 81 C, more than 80 C."), (80.0, "")):
        for _ in range(2):
            robot.sense(temperature=celsius)
            robot.wait(500)
        robot.order()
        assert robot.tick().stop_reason == reason


@pytest.mark.parametrize(
    ("name", "limits", "stops"),
    [
        ("bumper", LimitPlan(), True),
        *((name, LimitPlan(), False) for name in ("wheel", "eye", "meter", "chip")),
        ("eye", LimitPlan(stop_distance_m=0.2), True),
        ("meter", LimitPlan(low_battery_v=0.5), True),
        ("chip", LimitPlan(high_temperature_c=0.5), True),
    ],
)
def test_a_failed_protective_sensor_stops(name: str, limits: LimitPlan, stops: bool) -> None:
    """A slow sensor stops the robot whatever it measures, because it delays stops."""
    robot = _driving(quick_car(limits))
    text = f"Sensor {name} fails and cannot protect the robot: No answer."
    robot.rules.sense(Sensing(failures={name: "No answer."}), _T0)
    decision = robot.tick()
    assert (decision.seq, decision.stop_reason) == ((None, text) if stops else (1, ""))
    robot.rules.sense(Sensing(failures={name: "Slow."}, slow={name}), _T0)
    assert robot.tick().stop_reason == f"Sensor {name} delays the robot: Slow."
    robot.rules.sense(Sensing(), _T0)
    assert robot.tick().seq == 1


@pytest.mark.parametrize("measures", ["tendons", "joints"])
@pytest.mark.parametrize("slow", [False, True])
def test_servos_that_fail_disarm_and_slow_ones_only_stop(slow: bool, measures: str) -> None:
    plan = replace(quick_car(), sensors=(SensorPlan("spools", "bus_servo", measures),))
    robot = _driving(plan)
    late = {"spools"} if slow else set[str]()
    robot.rules.sense(Sensing(failures={"spools": "Overload."}, slow=late), _T0)
    assert (robot.rules.armed, robot.rules.disarmed) == (
        (True, "") if slow else (False, "Disarmed: Overload.")
    )
    assert robot.tick().actions == (0.0, 0.0)
    robot.arm()
    robot.order()
    assert robot.tick().stop_reason.endswith(": Overload.")


def test_an_unmeasured_speed_is_estimated() -> None:
    steering, throttle = quick_car().actions
    known = replace(throttle, unit="m/s", gain=3.0)
    robot = _driving(replace(quick_car(), actions=(steering, known)))
    assert robot.sense() == {"speed": 1.5}
    assert robot.rules.senses.sources == {"speed": "estimated"}
    assert robot.sense(speed=1.0)["speed"] == 1.0


@pytest.mark.parametrize(
    ("sensed", "stalled", "collision", "source"),
    [
        ({"bump": 1.0}, None, 1.0, "bumper"),
        ({"bump": 0.0, "speed": 0.0}, False, 0.0, "bumper"),
        ({"bump": 0.0, "speed": 0.0}, True, 1.0, "estimated"),
        ({"speed": 1.0}, False, 0.0, "estimated"),
    ],
)
def test_a_collision_names_its_source(
    sensed: dict[str, float], stalled: bool | None, collision: float, source: str
) -> None:
    sensing = Sensing(dict(sensed), {name: _SOURCES[name] for name in sensed})
    sensing.conclude(speed=None, stalled=stalled)
    assert sensing.quantities["collision"] == collision
    assert sensing.sources["collision"] == source
