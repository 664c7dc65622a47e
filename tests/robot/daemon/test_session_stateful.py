"""Sessions under random messages in random order: only permitted clients move the robot."""

import math
from typing import Any

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
)

from shapechanger.errors import LinkError
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.link.messages import (
    VERSION,
    Arm,
    Browse,
    Command,
    Disarm,
    EmergencyStop,
    Fetch,
    Hello,
    Judge,
    Mark,
    Record,
    Release,
    Suggest,
    Take,
    Undo,
    encode,
)
from tests.robot.daemon.fakes import SteppedClock
from tests.robot.daemon.plans import car_plan, guard_state

MAX_AGE_NS = 400 * 1_000_000
DEADLINE_NS = 250 * 1_000_000
_places = st.integers(0, 3)
_numbers = st.sampled_from((0.0, 0.5, -1.0, 3.0, math.nan, math.inf))


class ClientModel:
    """State of one client in the reference model, which shares no code with the daemon."""

    def __init__(self, role: str) -> None:
        self.role = role
        self.sent: dict[int, int] = {}
        self.newest_command = -1
        self.newest_suggestion = -1


class Robot(RuleBasedStateMachine):
    """Four clients that send anything at any time, and a reference model of the rules."""

    def __init__(self) -> None:
        super().__init__()
        self.clock = SteppedClock()
        self.orders: list[Order] = []
        self.allowed: list[tuple[int, tuple[float, ...]]] = []
        self.sessions: dict[int, Session] = {}
        self.models: dict[int, ClientModel] = {}
        self.holder: int | None = None
        self.numbers = 0
        self.commanded_ns = 0
        self.stops = 0
        self.halts = 0
        # Place, values and expiry (ns) of the newest suggestion.
        self.suggestion: tuple[int, tuple[float, ...], int] | None = None

    @initialize(arming=st.sampled_from(("person", "anyone")))
    def serve(self, arming: Any) -> None:
        self.anyone_arms, self.emergency = arming == "anyone", False
        self.hub = SessionHub(car_plan(arming=arming), self.clock, self.orders.append)

    def connected(self) -> bool:
        return bool(self.sessions)

    @rule(place=_places, role=st.sampled_from(("person", "program")))
    def connect(self, place: int, role: Any) -> None:
        if place in self.sessions:
            return
        self.numbers += 1
        session = Session(self.numbers, self.hub, Authenticator())
        session.introduce(encode(Hello(version=VERSION, proof=b"", role=role)))
        self.sessions[place], self.models[place] = session, ClientModel(role)

    @rule(place=_places)
    def leave(self, place: int) -> None:
        """A client leaves; if it had control, the robot is disarmed."""
        if place not in self.sessions:
            return
        self.hub.leave(self.sessions.pop(place).client)
        self.forget_suggestion(place)
        if self.holder == place:
            self.holder = None
            self.stops += 1

    @rule(place=_places)
    def take(self, place: int) -> None:
        """A client asks for control."""
        if not self.send(place, Take()):
            return
        held = None if self.holder is None else self.models[self.holder].role
        if held is None or (held == "program" and self.models[place].role == "person"):
            self.halts += held is not None
            self.holder = place
            self.forget_suggestion(place)

    @rule(place=_places)
    def release(self, place: int) -> None:
        """A client gives control back, whether or not it has it."""
        if self.send(place, Release()) and self.holder == place:
            self.holder = None
            self.stops += 1

    @rule(place=_places, emergency=st.integers(0, 2), back=st.integers(-1, 3))
    def arm(self, place: int, emergency: int, back: int) -> None:
        """A client that sees the robot can arm it if a client has control.

        It must be a person; or, if anyone may arm, a program in control without an emergency.
        """
        if place not in self.sessions:
            return
        before, answers = len(self.orders), self.answers(place, back)
        self.send(place, Arm(answers=answers, emergency=emergency))
        person = self.models[place].role == "person"
        program = self.anyone_arms and not self.emergency and self.holder == place
        may = self.holder is not None and (person or program)
        orders = [(order.kind, order.person, order.emergency) for order in self.orders[before:]]
        arms = [("arm", person, emergency)] if may and self.is_fresh(place, answers) else []
        assert orders == arms

    @rule(place=_places)
    def stop(self, place: int) -> None:
        before = len(self.orders)
        if self.send(place, EmergencyStop(reason="because")):
            assert [order.kind for order in self.orders[before:]] == ["emergency"]

    @rule(place=_places)
    def disarm(self, place: int) -> None:
        """A person can disarm the robot, and so can the client in control."""
        before = len(self.orders)
        if self.send(place, Disarm()):
            may = self.models[place].role == "person" or self.holder == place
            assert [order.kind for order in self.orders[before:]] == (["disarm"] if may else [])

    @precondition(connected)
    @rule(place=_places)
    def observe(self, place: int) -> None:
        if place in self.sessions:
            observation = self.sessions[place].observe()
            assert observation.mine == (self.holder == place)
            self.models[place].sent[observation.seq] = self.clock.ns

    @precondition(connected)
    @rule(
        place=_places,
        seq=st.integers(0, 12),
        back=st.integers(-1, 3),
        values=st.lists(_numbers, min_size=1, max_size=3).map(tuple),
        scale=st.floats(0.0, 1.0),
    )
    def command(
        self, place: int, seq: int, back: int, values: tuple[float, ...], scale: float
    ) -> None:
        """A client sends a command: new, old, repeated, in answer to any number, or invalid."""
        if place not in self.sessions:
            return
        model = self.models[place]
        answers = self.answers(place, back)
        message = Command(seq=seq, answers=answers, values=values, scale=scale)
        if self.holder == place and seq > model.newest_command:
            if len(values) != 2 or not all(map(math.isfinite, values)):
                self.halts += 1
            elif self.is_fresh(place, answers):
                self.allowed.append((seq, tuple(scale * value for value in values)))
                self.commanded_ns = self.clock.ns
        model.newest_command = max(model.newest_command, seq)
        assert self.send(place, message)

    @precondition(connected)
    @rule(
        place=_places,
        seq=st.integers(0, 12),
        back=st.integers(-1, 3),
        values=st.lists(_numbers, min_size=1, max_size=3).map(tuple),
    )
    def suggest(self, place: int, seq: int, back: int, values: tuple[float, ...]) -> None:
        """A suggestion counts if its sender does not have control, and moves nothing."""
        if place not in self.sessions:
            return
        before, model, answers = len(self.orders), self.models[place], self.answers(place, back)
        new = seq > model.newest_suggestion
        model.newest_suggestion = max(model.newest_suggestion, seq)
        good = len(values) == 2 and all(map(math.isfinite, values))
        self.send(place, Suggest(seq=seq, answers=answers, values=values))
        if self.holder != place and new and good and self.is_fresh(place, answers):
            self.suggestion = place, values, self.clock.ns + DEADLINE_NS
        assert len(self.orders) == before

    @rule(
        place=_places,
        request=st.sampled_from(
            (
                Record(on=True),
                Record(on=False),
                Mark(text="here"),
                Undo(),
                Browse(),
                Fetch(episode="20260101T000000Z-0001"),
                Judge(episode="20260101T000000Z-0001", first=0, last=3),
            )
        ),
    )
    def ask_about_recordings(self, place: int, request: Any) -> None:
        """A robot without a folder refuses requests about recordings, and nothing moves."""
        before = len(self.orders)
        if self.send(place, request):
            assert len(self.orders) == before
            assert not self.hub.recorder.on

    @rule(milliseconds=st.integers(1, 600))
    def wait(self, milliseconds: int) -> None:
        self.clock.ns += milliseconds * 1_000_000

    @rule(garbage=st.binary(max_size=20), place=_places)
    def garbage(self, garbage: bytes, place: int) -> None:
        """A client that sends invalid bytes is disconnected."""
        if place not in self.sessions:
            return
        before = len(self.orders)
        try:
            self.sessions[place].receive(b"\xc1" + garbage)
        except LinkError:
            assert len(self.orders) == before
            self.leave(place)

    @rule(emergency=st.booleans())
    def report(self, emergency: bool) -> None:
        """A state of the guard and a frame arrive."""
        self.emergency = emergency
        self.hub.on_state(guard_state(at_ns=self.clock.ns, armed=True, emergency=emergency))
        self.hub.on_frame(Frame(b"jpeg", self.clock.ns))

    @invariant()
    def only_allowed_commands_reach_the_guard(self) -> None:
        """The guard gets the model's commands, in order, with increasing lease and number."""
        commands = [order for order in self.orders if order.kind == "command"]
        assert [(order.seq, order.values) for order in commands] == self.allowed
        numbers = [(order.session, order.seq) for order in commands]
        assert numbers == sorted(set(numbers))

    @invariant()
    def the_loss_of_control_disarms_the_robot(self) -> None:
        """Each client that had control and left caused one order to disarm, with its reason."""
        lost = [o for o in self.orders if o.kind == "disarm" and not o.reason.endswith("disarmed")]
        assert len(lost) == self.stops
        assert all(order.reason for order in lost)

    @invariant()
    def only_invalid_commands_and_a_new_holder_halt_the_robot(self) -> None:
        """Late, repeated and foreign commands do not halt it."""
        assert sum(order.kind == "halt" for order in self.orders) == self.halts

    @invariant()
    def the_lease_has_the_expected_holder(self) -> None:
        held = self.hub.holder
        place = next((p for p, s in self.sessions.items() if s.client == held), None)
        assert place == self.holder

    @invariant()
    def the_newest_suggestion_is_shown_until_it_expires(self) -> None:
        """Values and sender equal the model's."""
        shown, expected = self.hub.observation(Client(0), 1, None), self.suggestion
        if expected is None or self.clock.ns > expected[2]:
            assert (shown.suggested, shown.suggested_by) == ((), "")
        else:
            name = self.sessions[expected[0]].client.name
            assert (shown.suggested, shown.suggested_by) == (expected[1], name)

    @invariant()
    def no_command_is_in_force_without_a_holder(self) -> None:
        commanded = self.hub.observation(Client(0), 1, None).commanded
        if self.holder is None or self.clock.ns - self.commanded_ns > DEADLINE_NS:
            assert commanded == ()
        elif commanded:
            assert commanded == self.allowed[-1][1]

    def forget_suggestion(self, place: int) -> None:
        if self.suggestion is not None and self.suggestion[0] == place:
            self.suggestion = None

    def answers(self, place: int, back: int) -> int:
        """Return the number of the last observation sent there, or of one `back` before it."""
        return max(0, max(self.models[place].sent, default=0) - back)

    def is_fresh(self, place: int, answers: int) -> bool:
        """Return True if the observation was sent there within the age limit."""
        sent_ns = self.models[place].sent.get(answers)
        return sent_ns is not None and self.clock.ns - sent_ns <= MAX_AGE_NS

    def send(self, place: int, message: Any) -> bool:
        """Send a message from a place. Return False if no client is there."""
        if place not in self.sessions:
            return False
        self.sessions[place].receive(encode(message))
        return True


TestRobot = Robot.TestCase
TestRobot.settings = settings(max_examples=150, stateful_step_count=60)
