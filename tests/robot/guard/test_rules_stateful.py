"""Invariants of the rules under arbitrary orders, readings and time steps.

The model below decides when the robot may propel, from the safety contract and independently of
the code of the rules.
"""

from dataclasses import replace

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from shapechanger.contract.plan import ActionPlan, GuardPlan, LimitPlan, StopPlan
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.guard.rules import Rules
from shapechanger.robot.guard.sensors import Sensing
from tests.robot.guard.plans import MS, car

_TICK_NS = 10 * MS
_DEADLINE_NS = 100 * MS

_levels = st.sampled_from(["any", "three"])
_slews = st.sampled_from([1.0, 5.0, float("inf")])
_values = st.one_of(st.floats(-1.5, 1.5), st.sampled_from([0.0, 1.0, -1.0, 1e300, -5]))
_ages = st.sampled_from([0, -50 * MS, -50 * MS - 1, 60 * MS, _DEADLINE_NS, _DEADLINE_NS - 1])
_ages |= st.integers(-60 * MS, 200 * MS)
_steps = st.one_of(
    st.integers(1, 30 * MS), st.sampled_from([1, _TICK_NS, _DEADLINE_NS, 20 * _DEADLINE_NS])
)


class _World(RuleBasedStateMachine):
    """The rules and a model of their invariants."""

    @initialize(
        levels=_levels,
        slew=_slews,
        slew_down=_slews,
        stop=st.sampled_from(["hold", "release"]),
        stale_ms=st.sampled_from([0, 60, 150]),
        drives=st.booleans(),
    )
    def start(
        self, levels: str, slew: float, slew_down: float, stop: str, stale_ms: int, drives: bool
    ) -> None:
        """Set up a car with or without a camera whose limit differs from the deadline."""
        self.stale_ns = stale_ms * MS
        limits = LimitPlan(
            deadline_ms=_DEADLINE_NS // MS,
            camera_stale_ms=stale_ms,
            stop_distance_m=0.2,
            low_battery_v=6.0,
        )
        actions = (
            ActionPlan("steering", -0.8, 0.5, 0.1, slew_per_s=slew, slew_down_per_s=slew_down),
            ActionPlan("throttle", -0.4, 0.6, slew_per_s=slew, levels=levels, propels=True),
        )
        plan = replace(car(limits, StopPlan(hold_ms=30, ramp_ms=40, then=stop)), actions=actions)
        self.plan: GuardPlan = plan
        self.now_ns = 10**12
        self.rules = Rules(plan, self.now_ns)
        self.armed = False
        self.emergency = False
        self.emergencies = 0
        self.newest = (-1, -1)
        self.acting: tuple[int, int] | None = None
        self.until_ns = 0
        self.frame_ns: int | None = None
        self.sensing = Sensing()
        self.forward_free_ns = self.sensed_ns = 0
        self.low_since_ns: int | None = None
        self.is_empty = False
        self.actions = tuple(action.rest for action in plan.actions)
        self.ticked_ns = self.now_ns
        if drives:
            self.drive([0.3, 0.4])

    @rule(
        session=st.integers(0, 3),
        seq=st.integers(0, 40),
        age_ns=_ages,
        ttl_ms=st.sampled_from([0, 1, 50, 100, 10_000, 10_000]),
        values=st.lists(_values, min_size=1, max_size=3),
        frame_age_ns=st.none() | st.just(0) | _ages,
        ahead=st.sampled_from([1, 1, 0, None]),
        is_good=st.booleans(),
    )
    def command(
        self,
        session: int,
        seq: int,
        age_ns: int,
        ttl_ms: int,
        values: list[float],
        frame_age_ns: int | None,
        ahead: int | None,
        is_good: bool,
    ) -> None:
        """Offer any command; half have the next number, and half the right number of values."""
        if ahead is not None:
            session, seq = max(self.newest[0], 0), self.newest[1] + ahead
        if is_good:
            values = (values * 2)[:2]
        issued_ns = self.now_ns - age_ns
        frame_ns = None if frame_age_ns is None else self.now_ns - frame_age_ns
        order = Order("command", session, seq, issued_ns, ttl_ms, frame_ns, tuple(values))
        refusal = self.rules.offer(order, self.now_ns)
        if frame_ns is not None and frame_ns <= self.now_ns + 50 * MS:
            self.frame_ns = max(min(frame_ns, self.now_ns), self.frame_ns or 0)
        until_ns = min(issued_ns, self.now_ns) + min(_DEADLINE_NS, ttl_ms * MS)
        is_newer = (session, seq) > self.newest
        self.newest = max(self.newest, (session, seq))
        is_due = is_newer and issued_ns <= self.now_ns + 50 * MS and self.now_ns < until_ns
        accepted = self.armed and is_due and len(values) == 2
        assert accepted == (not refusal)
        if is_due and len(values) != 2:
            self.acting = None  # An invalid newer command ends the previous one.
        if accepted:
            self.acting, self.until_ns = (session, seq), until_ns

    @rule(values=st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=2))
    def drive(self, values: list[float]) -> None:
        """Arm and send a valid command, so that there is motion to stop."""
        self.arm(0, 0, person=True)
        self.command(0, 0, 0, 1_000, values, 0, ahead=1, is_good=True)

    @rule(steps=st.integers(2, 30))
    def run_ticks(self, steps: int) -> None:
        for _ in range(steps):
            self.wait_for_the_rules()
            self.holds()

    @rule(
        age_ns=st.sampled_from([0, 0, 999 * MS, 1_000 * MS]),
        behind=st.integers(-1, 1),
        person=st.booleans(),
    )
    def arm(self, age_ns: int, behind: int, person: bool) -> None:
        """Arm, possibly with another count of emergency stops, or as a program."""
        seen = max(0, self.emergencies - behind)
        order = Order("arm", issued_ns=self.now_ns - age_ns, emergency=seen, person=person)
        refusal = self.rules.offer(order, self.now_ns)
        aware = not self.emergency or (person and seen == self.emergencies)
        assert (age_ns < 1_000 * MS and aware) == (not refusal)
        if not refusal:
            self.armed, self.emergency, self.acting = True, False, None
            self.is_empty = self.is_low()

    @rule(kind=st.sampled_from(["disarm", "emergency", "end"]))
    def stop(self, kind: str) -> None:
        """Disarm, stop or end."""
        assert not self.rules.offer(Order(kind), self.now_ns)
        self.armed, self.acting = False, None
        if kind == "emergency":
            self.emergency, self.emergencies = True, self.emergencies + 1

    @rule()
    def halt(self) -> None:
        assert not self.rules.offer(Order("halt"), self.now_ns)
        self.acting = None

    @rule(
        bump=st.booleans(),
        distance=st.sampled_from([0.1, 1.0]),
        speed=st.sampled_from([0.0, 0.5]),
        volts=st.sampled_from([5.0, 7.0, 7.0]),
        fails=st.sampled_from(["", "", "", "bumper", "wheel", "meter", "eye"]),
        is_slow=st.booleans(),
    )
    def sense(
        self, bump: bool, distance: float, speed: float, volts: float, fails: str, is_slow: bool
    ) -> None:
        """Report any sensor readings."""
        quantities = {"bump": float(bump), "distance": distance, "speed": speed, "battery": volts}
        names = {"bumper": "bump", "wheel": "speed", "meter": "battery", "eye": "distance"}
        quantities.pop(names.get(fails, ""), None)
        if quantities.get("battery", 7.0) >= 6.0:
            self.low_since_ns = None
        elif self.low_since_ns is None:
            self.low_since_ns = self.now_ns
        self.sensed_ns = self.now_ns
        self.is_empty = self.is_empty or self.is_low()
        self.sensing = Sensing(
            quantities,
            dict.fromkeys(quantities, "one"),
            {fails: "No answer."} if fails else {},
            {fails} if fails and is_slow else set(),
        )
        self.rules.sense(self.sensing, self.now_ns)
        if quantities.get("bump"):
            self.forward_free_ns = self.now_ns + self.plan.limits.bump_hold_ms * MS

    @rule(step_ns=_steps)
    def wait(self, step_ns: int) -> None:
        self.now_ns += step_ns

    @rule()
    def wait_for_the_rules(self) -> None:
        """Advance to the wake time of the rules, which is no later than any change."""
        wake_ns = self.rules.next_wake_ns(self.now_ns)
        changes = [self.now_ns + _TICK_NS, self.forward_free_ns]
        changes += [self.until_ns] * (self.acting is not None)
        if self.stale_ns and self.frame_ns is not None:
            changes.append(self.frame_ns + self.stale_ns)
        assert self.now_ns < wake_ns <= min(at_ns for at_ns in changes if at_ns > self.now_ns)
        self.now_ns = wake_ns

    def is_low(self) -> bool:
        """Return True if the battery was low for half a second when it was measured last."""
        return self.low_since_ns is not None and self.sensed_ns - self.low_since_ns >= 500 * MS

    @invariant()
    def holds(self) -> None:
        """Check all invariants."""
        if not hasattr(self, "rules"):
            return
        now_ns = self.now_ns
        decision = self.rules.tick(now_ns)
        elapsed_s = (now_ns - self.ticked_ns) / 1e9
        self.ticked_ns = now_ns
        before, self.actions = self.actions, decision.actions
        throttle = self.actions[1]

        is_fresh = self.acting is not None and now_ns < self.until_ns
        if not is_fresh:
            self.acting = None
        is_blind = bool(self.stale_ns) and (
            self.frame_ns is None or now_ns - self.frame_ns >= self.stale_ns
        )
        may_act = self.armed and not self.emergency and is_fresh and not is_blind
        protects_no_longer = self.sensing.failures.keys() & {"bumper", "meter", "eye"}
        may_act = may_act and not (protects_no_longer or self.sensing.slow or self.is_empty)
        assert (decision.seq is not None) == may_act
        if decision.seq is None:
            assert throttle == 0.0
            assert decision.stop_reason
        else:
            assert (decision.session, decision.seq) == self.acting
            assert not decision.release
        if throttle > 0.0:
            assert now_ns >= self.forward_free_ns
            assert self.sensing.quantities.get("distance", 1.0) >= 0.2
        assert self.rules.emergencies == self.emergencies

        for action, old, new in zip(self.plan.actions, before, self.actions, strict=True):
            assert action.low <= new <= action.high
            was, is_now = old - action.rest, new - action.rest
            assert was * is_now >= 0.0, "a change of sign must pass through rest"
            if action.levels == "three":
                assert new in (action.low, action.rest, action.high)
            elif abs(is_now) > abs(was) and action.slew_per_s < float("inf"):
                assert abs(is_now) - abs(was) <= action.slew_per_s * elapsed_s + 1e-9
            elif decision.seq is not None and action.slew_down_per_s < float("inf"):
                assert abs(was) - abs(is_now) <= action.slew_down_per_s * elapsed_s + 1e-9


TestRules = _World.TestCase
TestRules.settings = settings(
    max_examples=200,
    stateful_step_count=30,
    suppress_health_check=[HealthCheck.too_slow],
)
