"""Anatomy, frames and MJCF files of the finger."""

from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from shapechanger.finger import visuals
from shapechanger.finger.anatomy import JOINT_REST, JOINTS, TENDONS
from shapechanger.finger.gap import GAPS
from shapechanger.finger.model import TARGET, FingerFigure, build_finger, finger_mjcf
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import DRIVES, drive_of
from tests.finger.commands import STRETCHED, at_rest, made


@pytest.mark.parametrize("mode", DRIVES)
@pytest.mark.parametrize("parameters", [NOMINAL, STRETCHED], ids=["stiff", "stretched"])
def test_anatomy_does_not_change_the_simulation(parameters: FingerParameters, mode: str) -> None:
    found = []
    for anatomy in (False, True):
        model = made(parameters, mode, anatomy=anatomy)
        data = at_rest(model, parameters)
        rng = np.random.default_rng(0)
        states = []
        for _ in range(100):
            data.ctrl[:] = rng.uniform(-1.0, 1.0, 7)
            mujoco.mj_step(model, data, 5)
            states.append(np.concatenate([data.qpos, data.qvel, data.act, data.actuator_force]))
        found.append(np.array(states))
    np.testing.assert_array_equal(*found)


_INSERTIONS = dict.fromkeys(TENDONS, "distal") | {"FDS": "middle", "DI": "proximal"}


@pytest.mark.parametrize("tendon", TENDONS)
def test_each_tendon_ends_at_its_bone(tendon: str) -> None:
    """Routes start in the hand, pass the bones in order, and end at the tendon's insertion."""
    model = made(anatomy=True)
    order = ["hand", "proximal", "middle", "distal"]
    for course in visuals.route_names(tendon):
        number = model.tendon(course).id
        first = model.tendon_adr[number]
        points = slice(first, first + model.tendon_num[number])
        sites = model.wrap_objid[points][model.wrap_type[points] == mujoco.mjtWrap.mjWRAP_SITE]
        bodies = [order.index(model.body(model.site_bodyid[site]).name) for site in sites]
        assert bodies == sorted(bodies)
        assert (bodies[0], order[bodies[-1]]) == (0, _INSERTIONS[tendon])


def test_routes_agree_with_the_moment_arms() -> None:
    """For moment arms above 2.5 mm, a visible route shortens when its tendon shortens."""
    model = made(anatomy=True)
    data = mujoco.MjData(model)
    routes = [model.tendon(f"{tendon}/course").id for tendon in TENDONS]

    def lengths(j: int, angle: float) -> np.ndarray:
        data.qpos[:] = JOINT_REST
        data.qpos[j] += angle
        mujoco.mj_forward(model, data)
        return data.ten_length[routes].copy()

    shown = np.stack([lengths(j, -0.05) - lengths(j, 0.05) for j in range(len(JOINTS))], axis=1)
    large = np.abs(NOMINAL.arms) > 2.5e-3
    # FDP and FDS are routed through the middle of the knuckle; their arms are slightly ulnar.
    large[:2, 1] = False
    assert large.sum() == 12
    np.testing.assert_array_equal(np.sign(shown[large]), np.sign(NOMINAL.arms[large]))


def test_show_sets_the_figure() -> None:
    figure = FingerFigure()
    pulled = np.linspace(0.0, 1.2, 7)
    figure.show(JOINT_REST, pulled, np.array([0.05, 0.01, -0.04]))
    np.testing.assert_array_equal(figure.data.qpos, JOINT_REST)
    body = figure.model.body(TARGET).id
    np.testing.assert_array_equal(figure.data.xpos[body], [0.05, 0.01, -0.04])
    widths = figure.model.tendon_width[[figure.model.tendon(f"{t}/course").id for t in TENDONS]]
    assert widths[0] == pytest.approx(visuals.THINNEST_M)
    assert widths[-1] == pytest.approx(visuals.THICKEST_M)
    assert (np.diff(widths[:6]) > 0.0).all()


DRIVE = drive_of("impedance", NOMINAL)
FINGERS = {"nominal": NOMINAL} | {
    name: gap.draw(np.random.default_rng(3)) for name, gap in GAPS.items()
}


def motion(model: mujoco.MjModel) -> np.ndarray:
    """Return states over one second of random commands, from a bent posture."""
    data = mujoco.MjData(model)
    data.qpos[:4] = 0.4, 0.1, 0.5, 0.2
    rng = np.random.default_rng(0)
    states = []
    for _ in range(50):
        data.ctrl[:] = rng.uniform(-1.0, 1.0, 7)
        mujoco.mj_step(model, data, round(0.02 / model.opt.timestep))
        states.append(np.concatenate([data.qpos, data.qvel, data.actuator_force]))
    return np.array(states)


@pytest.mark.parametrize("name", FINGERS)
def test_the_mjcf_file_moves_like_the_simulated_finger(name: str) -> None:
    parameters = FINGERS[name]
    loaded = mujoco.MjModel.from_xml_string(finger_mjcf(parameters, DRIVE))
    own = motion(build_finger(parameters, DRIVE).compile())
    assert np.ptp(own[:, 0]) > 0.1
    np.testing.assert_allclose(motion(loaded), own, rtol=0.0, atol=1e-9)


def numbers(parameters: FingerParameters) -> dict[str, list[float]]:
    model = mujoco.MjModel.from_xml_string(finger_mjcf(parameters, DRIVE))
    names = [model.numeric(i).name for i in range(model.nnumeric)]
    return {name: model.numeric(name).data.tolist() for name in names}


def test_the_mjcf_file_has_the_parameters_with_units() -> None:
    """Numbers are exact, each has a unit, and a comment lists effects that are not simulated."""
    parameters = FINGERS["real-like"]
    found = numbers(parameters)
    assert found["moment_arms"] == parameters.arms.ravel().tolist()
    assert found["slew_per_s"] == [20.0]
    assert found["tendon_stiffness"] == [parameters.tendon_stiffness]
    assert "tendon_stiffness" not in numbers(NOMINAL)
    text = finger_mjcf(parameters, DRIVE)
    assert 'name="motor_kg/unit" data="kg"' in text
    assert all(f'name="{name}/unit"' in text for name in found)
    assert "computed at 50 Hz, sent at 100 Hz, with a slew of 20 up and 20 down" in text
    assert "path of a command" not in finger_mjcf(NOMINAL, DRIVE)


_SIZE = {"width": 160, "height": 120}


@pytest.fixture
def finger() -> Iterator[Any]:
    with gym.make("shapechanger/Finger-v1", render_mode="rgb_array", **_SIZE) as env:
        env.reset(seed=0, options={"posture": JOINT_REST.tolist()})
        yield env


def _differs(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the pixels that differ by more than rounding."""
    return np.any(np.abs(one.astype(int) - other.astype(int)) > 4, axis=2)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_frame_shows_posture_and_target_of_the_finger(finger: Any) -> None:
    frame = finger.render()
    assert (frame.shape, frame.dtype) == ((120, 160, 3), np.uint8)
    border = np.concatenate([frame[0], frame[-1], frame[:, 0], frame[:, -1]])
    assert border.min() > 190
    assert 0.03 < (frame.min(axis=2) < 180).mean() < 0.4
    np.testing.assert_array_equal(finger.render(), frame)
    for _ in range(2):
        finger.step(np.array([1, 1, -1, -1, -1, -1, -1], np.float32))
    assert _differs(finger.render(), frame).mean() > 0.005
    frames = []
    for target in ((0.07, 0.0, -0.02), (0.03, 0.0, -0.06)):
        finger.reset(seed=0, options={"posture": JOINT_REST.tolist(), "target": target})
        frames.append(finger.render())
    assert 0.001 < _differs(*frames).mean() < 0.1


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_rendering_does_not_change_the_episode() -> None:
    found = []
    for mode in (None, "rgb_array"):
        with gym.make("shapechanger/Finger-v1", render_mode=mode, **_SIZE) as env:
            env.reset(seed=3)
            rng = np.random.default_rng(0)
            seen = []
            for _ in range(5):
                seen.append(env.step(rng.uniform(-1, 1, 7).astype(np.float32))[0])
                env.render()
                if mode:
                    env.unwrapped.picture(64, 48)
            found.append(np.array(seen))
    np.testing.assert_array_equal(*found)


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_picture_shows_the_whole_finger_and_no_target(finger: Any) -> None:
    pictures = []
    for target in ((0.07, 0.0, -0.02), (0.03, 0.0, -0.06)):
        finger.reset(seed=0, options={"posture": JOINT_REST.tolist(), "target": target})
        pictures.append(finger.unwrapped.picture(**_SIZE))
    np.testing.assert_array_equal(*pictures)
    dark = pictures[0].min(axis=2) < 190
    assert dark.mean() > 0.01
    assert not np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]]).any()
    assert np.ptp(np.flatnonzero(dark.any(axis=0))) > 0.25 * 160


def test_the_legend_shows_tensions() -> None:
    """Bars in the colours of the tendons grow with the tension; small frames have no bars."""
    frame = np.full((360, 480, 3), 230, np.uint8)
    slack, taut = (visuals.tendon_legend(frame, np.full(7, pulled)) for pulled in (0.0, 1.0))
    assert slack.shape == frame.shape
    for colour in visuals.TENDON_COLOURS.values():
        paint = np.round(255 * np.array(colour))
        drawn = [int((one == paint).all(axis=2).sum()) for one in (slack, taut)]
        assert drawn[1] > 20 * drawn[0]
        assert drawn[1] > 200
    assert (taut[45:] == 230).all()  # The legend leaves room for the finger.
    assert (frame == 230).all()
    small = frame[:120, :160]
    assert visuals.tendon_legend(small, np.ones(7)) is small
