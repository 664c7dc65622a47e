"""`FingerTrack-v1`: paths, observations and errors."""

import math
import re

import numpy as np
import pytest

from shapechanger.errors import PathError, UnknownName
from shapechanger.finger.anatomy import JOINT_REST
from shapechanger.finger.paths import KINDS, circle
from shapechanger.finger.postures import angles_for
from shapechanger.finger.track import PREVIEW_S, FingerTrackEnv, draw_path, require_reachable

_NOTHING = np.zeros(7, np.float32)


@pytest.mark.parametrize("kind", KINDS)
def test_default_shapes_can_be_followed(kind: str) -> None:
    """Each shape is reachable with default settings, and the finger starts on it at rest."""
    env = FingerTrackEnv(path=kind)
    _, info = env.reset(seed=1)
    assert info["distance"] < 1e-5
    np.testing.assert_array_equal(env.plant.data.qvel, 0.0)


def test_observations_look_ahead() -> None:
    """Observations have points 0.02, 0.06, 0.12 and 0.20 s ahead, relative to the fingertip."""
    env = FingerTrackEnv()
    seen, info = env.reset(seed=0)
    begins = info["target"]
    times = np.linspace(0.0, 2.0, 200_001)
    t = times[np.linalg.norm(env.path.at(times) - begins, axis=1).argmin()]
    for step in range(4):
        named = dict(zip(env.observation_layout.names, seen, strict=True))
        tip = np.array([named[f"fingertip/{axis}"] for axis in "xyz"])
        now = t + 0.02 * step
        point = np.array([named[f"target/{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(point, env.path.at(now + 0.02), atol=2e-6)
        way = np.array([named[f"target/d{axis}"] for axis in "xyz"])
        np.testing.assert_allclose(tip + way, point, atol=1e-12)
        for ahead in PREVIEW_S:
            way = [named[f"ahead_{round(1e3 * ahead)}ms/d{axis}"] for axis in "xyz"]
            np.testing.assert_allclose(tip + way, env.path.at(now + ahead), atol=2e-6)
        seen, _, _, _, info = env.step(_NOTHING)
        np.testing.assert_allclose(info["target"], point, atol=1e-12)


def test_the_rms_error_starts_after_half_a_second() -> None:
    """`rms` is infinite for 0.5 s; then it is the RMS distance from 0.5 s on."""
    env = FingerTrackEnv()
    _, info = env.reset(seed=0)
    assert info["rms"] == math.inf
    distances: list[float] = []
    for _ in range(40):
        *_, info = env.step(_NOTHING)
        distances.append(info["distance"])
        assert distances[-1] == pytest.approx(math.dist(env.plant.fingertip, info["target"]))
        late = distances[25:]
        expected = np.sqrt(np.mean(np.square(late))) if late else math.inf
        assert info["rms"] == pytest.approx(expected)
        assert info["is_success"] == (info["rms"] < 0.003)
    assert env.reset(seed=0)[1]["rms"] == math.inf


@pytest.mark.parametrize("place", [(0.08, 0.0, -0.04), (0.05, 0.08, -0.03)])
def test_a_path_that_leaves_the_workspace_is_refused(place: tuple[float, float, float]) -> None:
    path = circle(0.012, place, hz=1.5)
    with pytest.raises(PathError, match="The path leaves the finger's reach: at ") as caught:
        FingerTrackEnv(path=path)
    pattern = r"at ([\d.]+) s the point \((.*), (.*), (.*)\) mm"
    at, *point = (float(number) for number in re.findall(pattern, str(caught.value))[0])
    np.testing.assert_allclose(point, 1e3 * path.at(at), atol=1.0)
    assert angles_for(path.at(at))[1] > 4e-4


def test_a_path_that_is_too_fast_is_refused() -> None:
    with pytest.raises(PathError, match=r"too weak .* at \d.\d\d s a joint lacks"):
        FingerTrackEnv(path={"kind": "circle", "hz": 8.0})
    require_reachable(circle(hz=1.3))


def test_another_path_can_be_given_at_a_reset() -> None:
    """A given path is kept in later episodes; an invalid path changes nothing."""
    env = FingerTrackEnv()
    env.reset(seed=0)
    first = env.path
    with pytest.raises(PathError, match="leaves the finger's reach"):
        env.reset(options={"path": circle(0.012, (0.09, 0.0, 0.0))})
    with pytest.raises(UnknownName, match=r"'circel'. Did you mean 'circle'"):
        env.reset(options={"path": "circel"})
    with pytest.raises(UnknownName, match="There are: posture, path"):
        env.reset(options={"target": [0.0, 0.0, 0.0]})
    assert env.path is first
    path = circle(0.008)
    env.reset(options={"path": path})
    env.reset()
    assert env.path is path
    env.reset(options={"posture": JOINT_REST.tolist()})
    np.testing.assert_array_equal(env.plant.angles, JOINT_REST)


@pytest.mark.slow
def test_random_paths_differ_and_can_be_followed() -> None:
    """The seed determines random paths; they are reachable, and last 0.5 to 10 s."""
    env = FingerTrackEnv(path="random")
    found = []
    for seed in (1, 2, 1):
        _, info = env.reset(seed=seed)
        assert info["distance"] < 1e-5
        found.append(env.path.at([0.0, 0.1, 0.3]))
    np.testing.assert_array_equal(found[0], found[2])
    assert (found[0] != found[1]).any()
    rng = np.random.default_rng(0)
    for _ in range(2):
        path, begin = draw_path(rng)
        assert path.closed
        assert 0.5 <= path.duration_s <= 10.0
        for point in path.at(np.linspace(0.0, path.duration_s, 20)):
            begin, off = angles_for(point, begin)
            assert off < 5e-4
