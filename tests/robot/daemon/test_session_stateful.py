"""Sessions under random messages in random order: only permitted clients move the robot."""

import math
from typing import Any, Literal

import pytest
from hypothesis import settings, stateful
from hypothesis import strategies as st

from shapechanger.errors import LinkError
from shapechanger.robot.cameras.camera import Frame
from shapechanger.robot.daemon.client import Client
from shapechanger.robot.daemon.credentials import Authenticator
from shapechanger.robot.daemon.hub import SessionHub
from shapechanger.robot.daemon.session import Session
from shapechanger.robot.guard.channel import Order
from shapechanger.robot.link import messages as link
from tests.robot.daemon.fakes import SteppedClock
from tests.robot.daemon.plans import car_plan, guard_state

MS = 1_000_000
MAX_AGE_NS = 400 * MS
DEADLINE_MS = 250
# Most messages have the next number and answer the newest observation.
_aheads = st.sampled_from((1, 1, 1, 2, 0, -1))
_backs = st.sampled_from((0, 0, 0, 1, 3, -1))
_numbers = st.sampled_from((0.0, 0.5, -1.0, 3.0, math.nan, math.inf))
_values = st.just((0.0, 0.5)) | st.lists(_numbers, min_size=1, max_size=3).map(tuple)

# Values of a command or suggestion, the name of its sender, and the time of its end, ns.
Pending = tuple[tuple[float, ...], str, int]
NOTHING: Pending = ((), "", -1)


class Connected:
    """A client, with its state in the reference model, which shares no code with the daemon."""

    def __init__(self, session: Session, role: Literal["person", "program"]) -> None:
        self.session = session
        self.role = role
        self.is_person = role == "person"
        self.sent: dict[int, int] = {}
        self.newest = {link.Command: -1, link.Suggest: -1}

    def answers(self, back: int) -> int:
        """Return the number of the observation `back` before the last one that was sent."""
        return max(0, max(self.sent, default=0) - back)

    def number(self, kind: type[link.Command | link.Suggest], ahead: int) -> tuple[int, bool]:
        """Return the newest number plus `ahead`, at least 0, and whether it is a larger number."""
        newest, number = self.newest[kind], max(0, self.newest[kind] + ahead)
        self.newest[kind] = max(newest, number)
        return number, number > newest


class Robot(stateful.RuleBasedStateMachine):
    """Up to four clients that send any message at any time, and a reference model of the rules."""

    clients = stateful.Bundle("clients")

    def __init__(self) -> None:
        super().__init__()
        self.clock = SteppedClock()
        self.orders: list[Order] = []
        self.allowed: list[tuple[int, tuple[float, ...]]] = []
        self.holder: Connected | None = None
        self.here = self.numbers = self.stops = self.halts = 0
        self.command_in_force = self.suggestion = NOTHING
        self.emergency = False

    @stateful.initialize(arming=st.sampled_from(("person", "anyone")))
    def serve(self, arming: Any) -> None:
        self.anyone_arms = arming == "anyone"
        self.hub = SessionHub(car_plan(arming=arming), self.clock, self.orders.append)
        self.report(False)

    @stateful.precondition(lambda self: self.here < 4)
    @stateful.rule(target=clients, role=st.sampled_from(("person", "program")))
    def connect(self, role: Any) -> Connected:
        self.here += 1
        self.numbers += 1
        session = Session(self.numbers, self.hub, Authenticator())
        session.introduce(link.encode(link.Hello(version=link.VERSION, proof=b"", role=role)))
        client = Connected(session, role)
        self.observe(client)
        return client

    @stateful.rule(client=stateful.consumes(clients), garbage=st.none() | st.binary(max_size=20))
    def leave(self, client: Connected, garbage: bytes | None) -> None:
        """A client disconnects or sends invalid bytes; if it had control, the robot is disarmed."""
        if garbage is not None:
            before = len(self.orders)
            with pytest.raises(LinkError):
                client.session.receive(b"\xc1" + garbage)
            assert len(self.orders) == before
        self.hub.leave(client.session.client)
        self.here -= 1
        self.forget_suggestion(client)
        self.lose_control(client)

    @stateful.rule(client=clients)
    def take(self, client: Connected) -> None:
        held = self.holder
        self.send(client, link.Take())
        if held is None or (client.is_person and not held.is_person) or held is client:
            self.forget_suggestion(client)
            if held not in (None, client):
                self.halts += 1
                self.command_in_force = NOTHING
            self.holder = client

    @stateful.rule(client=clients)
    def release(self, client: Connected) -> None:
        self.send(client, link.Release())
        self.lose_control(client)

    @stateful.rule(
        client=clients, by_holder=st.booleans(), emergency=st.integers(0, 2), back=_backs
    )
    def arm(self, client: Connected, by_holder: bool, emergency: int, back: int) -> None:
        """Arms on a fresh observation: a person, or, if anyone may, the program in control."""
        client = self.actor(client, by_holder)
        answers = client.answers(back)
        orders = self.send(client, link.Arm(answers=answers, emergency=emergency))
        program = self.anyone_arms and not self.emergency and self.holder is client
        may = self.holder is not None and (client.is_person or program)
        arms = may and self.is_fresh(client, answers)
        expected = [("arm", client.is_person, emergency)] if arms else []
        assert [(order.kind, order.person, order.emergency) for order in orders] == expected

    @stateful.rule(client=clients)
    def stop(self, client: Connected) -> None:
        (order,) = self.send(client, link.EmergencyStop(reason="a\x1b[2Jcat"))
        reason = f"{client.session.client.name}: a [2Jcat"
        assert (order.kind, order.reason) == ("emergency", reason)

    @stateful.rule(client=clients)
    def disarm(self, client: Connected) -> None:
        """A person can disarm the robot, and so can the client in control."""
        orders = self.send(client, link.Disarm())
        may = client.is_person or self.holder is client
        assert [order.kind for order in orders] == (["disarm"] if may else [])

    @stateful.rule(client=clients)
    def observe(self, client: Connected) -> None:
        seen = client.session.observe()
        assert seen.mine == (self.holder is client)
        client.sent[seen.seq] = self.clock.ns

    @stateful.rule(
        client=clients,
        by_holder=st.booleans(),
        ahead=_aheads,
        back=_backs,
        values=_values,
        scale=st.floats(0.0, 1.0),
        ttl_ms=st.sampled_from((1, 100, 250, 400)),
    )
    def command(
        self,
        client: Connected,
        by_holder: bool,
        ahead: int,
        back: int,
        values: tuple[float, ...],
        scale: float,
        ttl_ms: int,
    ) -> None:
        """A command may be old, repeated or invalid; half are valid and sent by the holder."""
        if by_holder:
            ahead, back, values = 1, 0, (0.5, -1.0)
        client = self.actor(client, by_holder)
        answers, (seq, is_new) = client.answers(back), client.number(link.Command, ahead)
        message = link.Command(seq=seq, answers=answers, values=values, scale=scale, ttl_ms=ttl_ms)
        orders = self.send(client, message)
        if self.holder is not client or not is_new:
            assert not orders
        elif not self.is_good(values):
            self.halts += 1
            self.command_in_force = NOTHING
        elif self.is_fresh(client, answers):
            scaled = tuple(scale * value for value in values)
            self.allowed.append((seq, scaled))
            until_ns = self.clock.ns + min(ttl_ms, DEADLINE_MS) * MS
            self.command_in_force = (scaled, "", until_ns)
            assert orders[0].ttl_ms == ttl_ms

    @stateful.rule(client=clients, ahead=_aheads, back=_backs, values=_values)
    def suggest(self, client: Connected, ahead: int, back: int, values: tuple[float, ...]) -> None:
        """A suggestion counts if its sender does not have control; it never moves the robot."""
        self.observe(client)
        answers, (seq, is_new) = client.answers(back), client.number(link.Suggest, ahead)
        assert not self.send(client, link.Suggest(seq=seq, answers=answers, values=values))
        counts = self.holder is not client and is_new and self.is_good(values)
        if counts and self.is_fresh(client, answers):
            name = client.session.client.name
            self.suggestion = (values, name, self.clock.ns + DEADLINE_MS * MS)

    @stateful.rule(
        client=clients,
        request=st.sampled_from(
            (
                *(
                    link.Record(on=True),
                    link.Record(on=False),
                    link.Mark(text="here"),
                    link.Undo(),
                    link.Browse(),
                ),
                link.Fetch(episode="20260101T000000Z-0001"),
                link.Judge(episode="20260101T000000Z-0001", first=0, last=3),
            )
        ),
    )
    def ask_about_recordings(self, client: Connected, request: Any) -> None:
        """A robot without a folder for recordings refuses requests about them."""
        assert not self.send(client, request)
        assert not self.hub.recorder.on

    @stateful.rule(milliseconds=st.sampled_from((1, 100, 250, 400)) | st.integers(1, 600))
    def wait(self, milliseconds: int) -> None:
        self.clock.ns += milliseconds * MS

    @stateful.rule(emergency=st.booleans())
    def report(self, emergency: bool) -> None:
        self.emergency = emergency
        self.hub.on_state(guard_state(at_ns=self.clock.ns, armed=True, emergency=emergency))
        self.hub.on_frame(Frame(b"jpeg", self.clock.ns))

    @stateful.invariant()
    def only_allowed_commands_reach_the_guard(self) -> None:
        """The guard gets the commands of the model, in order, with increasing lease and number."""
        commands = [order for order in self.orders if order.kind == "command"]
        assert [(order.seq, order.values) for order in commands] == self.allowed
        numbers = [(order.session, order.seq) for order in commands]
        assert numbers == sorted(set(numbers))

    @stateful.invariant()
    def the_loss_of_control_disarms_the_robot(self) -> None:
        """Each loss of control by a disconnection or release causes one order to disarm."""
        lost = [o for o in self.orders if o.kind == "disarm" and not o.reason.endswith("disarmed")]
        assert len(lost) == self.stops
        assert all(order.reason for order in lost)

    @stateful.invariant()
    def only_invalid_commands_and_a_new_holder_halt_the_robot(self) -> None:
        """Late and repeated commands, and commands of other clients, do not halt the robot."""
        assert sum(order.kind == "halt" for order in self.orders) == self.halts

    @stateful.invariant()
    def the_expected_commands_are_shown(self) -> None:
        """Holder, current command and newest suggestion are the same as in the model."""
        held = None if self.holder is None else self.holder.session.client
        assert self.hub.holder is held
        shown, now_ns = self.hub.observation(Client(0), 1, None), self.clock.ns
        command, suggestion = (
            pending if now_ns <= pending[2] else NOTHING
            for pending in (self.command_in_force, self.suggestion)
        )
        assert shown.commanded == command[0]
        assert (shown.suggested, shown.suggested_by) == suggestion[:2]

    def actor(self, client: Connected, by_holder: bool) -> Connected:
        """Return the client in control, after an observation, if `by_holder`; else `client`."""
        if not by_holder or self.holder is None:
            return client
        self.observe(self.holder)
        return self.holder

    def lose_control(self, client: Connected) -> None:
        if self.holder is client:
            self.holder, self.command_in_force = None, NOTHING
            self.stops += 1

    def forget_suggestion(self, client: Connected) -> None:
        if self.suggestion[1] == client.session.client.name:
            self.suggestion = NOTHING

    @staticmethod
    def is_good(values: tuple[float, ...]) -> bool:
        return len(values) == 2 and all(map(math.isfinite, values))

    def is_fresh(self, client: Connected, answers: int) -> bool:
        """Return True if the observation was sent to the client within the age limit."""
        sent_ns = client.sent.get(answers)
        return sent_ns is not None and self.clock.ns - sent_ns <= MAX_AGE_NS

    def send(self, client: Connected, message: Any) -> list[Order]:
        before = len(self.orders)
        client.session.receive(link.encode(message))
        return self.orders[before:]


TestRobot = Robot.TestCase
TestRobot.settings = settings(max_examples=150, stateful_step_count=60)
