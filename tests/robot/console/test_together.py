"""The console with other clients, a slow page, a restarted robot, and recordings."""

import contextlib
import os
import signal
import socket
from collections.abc import Callable
from pathlib import Path

import pytest
from playwright.sync_api import Browser

from shapechanger.demos.cloning.network import CameraPolicy
from shapechanger.demos.episodes import episodes_of, read_episode
from shapechanger.errors import LinkError
from shapechanger.robot.profile import load
from shapechanger.robot.twin.robot import RunningRobot, run_robot
from tests.demos.cloning.data import clone_card
from tests.robot.console.browser import Console, Pins
from tests.robot.twin.robots import until
from tests.robots import IN_A_ROOM, PATIENT_CAR, write_profile

pytestmark = [pytest.mark.realtime, pytest.mark.system]

Visit = Callable[..., Console]

_SHIPPED = Path(load.__file__).parent / "shipped"


def test_a_second_person_cannot_take_control(car: RunningRobot, visit: Visit) -> None:
    first, second, pins = visit(car), visit(car), Pins(car)
    first.arm()
    second.await_state(link="open", driver="person")
    second.page.keyboard.press("e")
    second.await_words("#log", "a person cannot take it from a person")
    second.page.keyboard.down("s")
    first.drive("w", pins, 1.0)
    second.page.keyboard.up("s")
    second.stop()
    pins.await_rest()
    first.await_state(robot="emergency", driver="me")
    first.page.keyboard.up("w")


def test_a_slow_page_stops_its_robot_and_delays_no_other_client(
    hasty_car: RunningRobot, visit: Visit
) -> None:
    console, pins = visit(hasty_car), Pins(hasty_car)
    console.arm()
    console.drive("w", pins)
    with hasty_car.client(frames=False) as observer:
        before = observer.ask().message
        console.page.evaluate(
            "setTimeout(() => { const end = performance.now() + 2000;"
            " while (performance.now() < end); document.body.dataset.hung = 'over'; })"
        )
        pins.await_deadline(observer, before)
        # Another client still gets observations, some before the page recovers.
        for _ in range(10):
            observer.ask()
    console.await_state(hung="over", robot="armed")
    console.await_words("#log", "let go, and press again")
    assert pins.propels() == 0.0
    console.page.keyboard.up("w")
    console.drive("w", pins)
    console.page.keyboard.up("w")
    console.stop()


def test_a_page_reconnects_after_a_restart_without_moving_the_robot(
    chromium: Browser, tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as found:
        port = found.getsockname()[1]
    arguments = (*IN_A_ROOM, "--port", str(port))
    profile = write_profile(tmp_path, PATIENT_CAR)
    with (
        run_robot(profile, folder=tmp_path, arguments=arguments) as robot,
        Console(chromium, robot) as console,
    ):
        console.arm()
        console.page.keyboard.down("w")
        pins = Pins(robot)
        pins.await_motion()
        robot.forget_ready()
        os.kill(robot.pid_of("daemon"), signal.SIGKILL)
        console.await_state(link="waiting", robot="lost")
        console.await_words("#connection", "Trying again")
        robot.await_restart()
        console.await_state(link="open")
        console.page.locator("body[data-robot='emergency'], body[data-robot='disarmed']").wait_for()
        assert pins.propels() == 0.0
        console.await_words("#log", "The robot does not move until you arm it.")
        console.page.keyboard.up("w")
        console.arm()
        console.drive("w", pins)
        console.page.keyboard.up("w")
        console.stop()


def test_a_displaced_page_reconnects_only_on_request(car: RunningRobot, visit: Visit) -> None:
    """If more pages than the limit reconnected by themselves, they would displace one another."""
    console = visit(car)
    console.await_state(link="open")
    with contextlib.ExitStack() as stack:
        clients = (car.client(role="person", name=f"person {n}", frames=False) for n in range(8))
        people = [stack.enter_context(client) for client in clients]
        console.await_state(link="displaced")
        console.await_words("#key-trouble", "8 clients are the limit. Connect again")
        for person in people:
            person.ping()
        console.page.click("#enter")
        console.await_state(link="open")
        with pytest.raises(LinkError, match="are the limit"):
            until(lambda: people[0].ask() is None, 60.0)


def test_recording_a_drive(car: RunningRobot, visit: Visit) -> None:
    console, pins = visit(car), Pins(car)
    page = console.page
    console.arm()
    page.keyboard.press("r")
    console.await_state(recording="true")
    console.drive("w", pins)
    page.keyboard.press("m")
    console.await_words("#recorder-state", "1 mark")
    page.keyboard.up("w")
    page.keyboard.press("u")
    console.await_words("#recorder-state", "undone")
    console.drive("s", pins, -1.0)
    page.keyboard.up("s")
    page.keyboard.press("r")
    console.await_state(recording="false")
    console.await_words("#recorder-state", "Recorded")
    (path,) = episodes_of(car.folder / "recordings")
    until(lambda: read_episode(path).closed, 60.0)
    episode = read_episode(path)
    assert len(episode.marks) == 1
    assert 0 < len(episode.kept) < len(episode.steps)
    assert all(episode.jpeg(step) for step in episode.steps)

    page.click("#browse")
    page.locator("#episode-list button").first.click()
    console.await_words("#episodes-state", "Loaded.")
    page.fill("#scrub", str(len(episode.steps) - 1))
    console.await_words("#step-state", "person:")
    page.click("#range-from")
    all_kept = len(episode.kept)
    for judgement, kept in (("#judge-bad", all_kept - 1), ("#judge-good", all_kept)):
        page.click(judgement)
        until(lambda kept=kept: len(read_episode(path).kept) == kept, 60.0)
    console.stop()


def test_sliders_drive_a_finger(chromium: Browser, tmp_path: Path) -> None:
    """Each slider starts at the tendon's present value; the tendon follows and keeps its value."""
    (tmp_path / "finger.toml").write_text((_SHIPPED / "finger-pwm.toml").read_text())
    with (
        run_robot(tmp_path / "finger.toml", folder=tmp_path, arguments=IN_A_ROOM) as robot,
        Console(chromium, robot) as console,
        robot.client(frames=False) as observer,
    ):
        console.arm()
        assert console.page.locator("#actions input").count() == 7
        assert console.page.locator("#pad").is_hidden()
        for _ in range(5):
            assert observer.ask().message.action_applied == pytest.approx((0.1,) * 7)
        console.page.locator("#actions input").nth(3).fill("0.5")
        wanted = (0.1, 0.1, 0.1, 0.5, 0.1, 0.1, 0.1)
        until(
            lambda: observer.ask().message.action_applied == pytest.approx(wanted, abs=0.01), 60.0
        )
        console.stop()


def test_a_policy_on_board_is_chosen_started_and_ended(chromium: Browser, tmp_path: Path) -> None:
    """The policy drives after a person has armed the robot, until a person presses a key."""
    car = write_profile(tmp_path, PATIENT_CAR)
    net = {"eyes": "none", "nerves": (1,), "low": (0.3, 0.3), "high": (0.3, 0.3)}
    card = clone_card(car.action_layout(), car.state_layout(), **net)
    folder = tmp_path / "policies"
    for name in ("novice", "student"):
        CameraPolicy.blank(card, seed=0).export(folder / f"{name}.onnx")
    arguments = (*IN_A_ROOM, "--policy", str(folder))
    with (
        run_robot(car, folder=tmp_path, arguments=arguments) as robot,
        Console(chromium, robot) as console,
    ):
        pins, page = Pins(robot), console.page
        console.await_state(link="open", driver="nobody")
        console.await_words("#policy-state", "None runs.")
        assert page.locator("#policy-name option").all_inner_texts() == ["novice", "student"]
        page.select_option("#policy-name", "student")
        page.click("#policy-run")
        console.await_state(driver="program", robot="disarmed")
        console.await_words("#state", "student has control; not armed.")
        page.click("#arm")
        pins.await_motion(1.0)
        console.await_words("#policy-state", "student: it drives")
        # A driving key takes control without rearming; the page shows the policy's suggestions.
        console.drive("s", pins, -1.0)
        console.await_state(driver="me", robot="armed")
        page.locator("#legend-wanted").wait_for()
        page.keyboard.up("s")
        pins.await_rest()
        page.click("#policy-run")
        console.await_words("#policy-state", "None runs.")
        (folder / "student.onnx").write_bytes(b"changed")
        page.click("#policy-run")
        console.await_words("#policy-state", "is not a policy that")
