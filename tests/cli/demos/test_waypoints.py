"""`demos train --waypoints`: from a driver's steering to a policy for any vehicle."""

from __future__ import annotations

import math
from contextlib import closing
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
import simplejpeg

from shapechanger.cli import main
from shapechanger.cli.demos import train
from shapechanger.cli.demos.train import DemosEvaluate, DemosTrain
from shapechanger.demos.dataset import Dataset, load_dataset
from shapechanger.demos.episodes import EpisodeHeader, EpisodeWriter, Step
from shapechanger.errors import DemosError, WorldError
from shapechanger.layout import Feature, Layout
from shapechanger.policy import load_policy
from shapechanger.transfer.learners.presets import LEARNERS
from shapechanger.vehicles.cameras.rectify import CanonicalView
from shapechanger.vehicles.cloning import CloningSettings
from shapechanger.vehicles.envs import WaypointEnv
from shapechanger.vehicles.waypoints import ACTION_LAYOUT, SteeringResponse, as_waypoints

_ACTIONS = Layout((Feature("steering", "1", -1.0, 1.0), Feature("throttle", "1", -1.0, 1.0)))
_MOTION = (Feature("speed", "m/s"), Feature("yaw_rate", "rad/s"))
_STATE = Layout((*_MOTION, Feature("steering/applied", "1", -1.0, 1.0)))
_PER_METRE = 1.9


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = LEARNERS["waypoint"]
    assert isinstance(settings, CloningSettings)
    few = {"fewest_steps": 10, "most_steps": 10, "warm_up": 1, "checks": 1, "batch": 16}
    clone = msgspec.structs.replace(settings.clone, channels=(4, 8), features=8, **few)
    quick = msgspec.structs.replace(settings, clone=clone)
    monkeypatch.setattr(train, "LEARNERS", {"waypoint": quick})


def _record(folder: Path, n: int = 60, *, state: Layout | None = _STATE, **changes: Any) -> Path:
    """Record a car that stands for ten steps and then drives as a person would drive it."""
    fields: dict[str, Any] = {
        "action_layout": _ACTIONS,
        "state_layout": state or Layout(()),
        "image_size": (160, 120),
        "body": "car",
        "camera_pitch_deg": 0.0,
        "camera_fovy_deg": 48.8,
        "clock": "none",
    }
    rng = np.random.default_rng(0)
    with EpisodeWriter.create(folder, EpisodeHeader(**(fields | changes))) as writer:
        for number in range(n):
            stands = number < 10
            steering = 0.1 * (number // 6 % 9 - 4)
            speed = 0.0 if stands else 1.5
            motion = {"speed": speed, "yaw_rate": -steering * _PER_METRE * speed}
            motion["steering/applied"] = steering
            picture = rng.integers(0, 255, (120, 160, 3), np.uint8)
            writer.add(
                Step(
                    action=(steering, 0.0 if stands else 0.6),
                    driver="person",
                    state=() if state is None else tuple(motion[name] for name in state.names),
                ),
                simplejpeg.encode_jpeg(picture, quality=80),
            )
        writer.close()
    return folder


def _loaded(data: Path, view: CanonicalView | None = None) -> Dataset:
    return load_dataset(data, shrink=CanonicalView() if view is None else view)


def test_a_drive_becomes_a_policy_of_waypoints(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The command reports its result, and the policy's card describes its actions.

    An evaluation converts the recording as training does, so it recognises the policy's recording.
    """
    data, out = _record(tmp_path / "drive"), tmp_path / "policy.safetensors"
    DemosTrain(data, out, waypoints=True, ppo=tmp_path / "ppo.zip").run()
    card = load_policy(out).card
    assert card.action == ACTION_LAYOUT
    assert card.data["response"] == pytest.approx([_PER_METRE, 0.0], abs=0.01)
    assert card.data["steps"] == 50
    printed = " ".join(capsys.readouterr().out.split())
    assert "looks 0 degrees down with a vertical field of view of 48.8" in printed
    assert "turns 1.90 rad for each metre and 0.00 for each second" in printed
    assert ", fitted to the recorded motion." in printed
    assert "16.7% of the steps are left out: the vehicle stands still" in printed
    assert "outside the image, which ends 31 degrees to each side" in printed
    DemosEvaluate(out, data).run()
    printed = " ".join(capsys.readouterr().out.split())
    assert ", fitted to the recorded motion." in printed
    assert "learned from the first 40 of these 50 steps" in printed
    assert "waypoint/bearing: mean absolute error" in printed
    other = _record(tmp_path / "other", state=None)
    with pytest.raises(DemosError, match="give --response"):
        DemosEvaluate(out, other).run()
    DemosEvaluate(out, other, response=(1.9, 0.0)).run()
    assert ", as given." in " ".join(capsys.readouterr().out.split())


def test_waypoints_are_on_the_circle_that_was_driven(tmp_path: Path) -> None:
    """Images are warped, and steps at rest are left out of all arrays."""
    _record(tmp_path)
    shown = as_waypoints(_loaded(_record(tmp_path, 20)))
    data = shown.data
    assert data.pictures is not None
    assert data.pictures.shape == (60, 48, 80, 3)
    assert data.episodes == (50, 10)
    assert shown.kept.tolist() == [False] * 10 + [True] * 50 + [False] * 10 + [True] * 10
    assert len(data.times_s) == len(data.files) == len(data.actions) == 60
    assert data.states is data.state_layout is None
    # The last steering of the first episode, 0.1 * (59 // 6 % 9 - 4), as a bearing 0.8 m ahead.
    np.testing.assert_allclose(data.actions[49], [math.asin(0.4 * 1.9 * -0.4), 0.2], atol=1e-3)


def test_images_of_each_camera_are_warped_by_its_geometry(tmp_path: Path) -> None:
    _record(tmp_path)
    _record(tmp_path, camera_pitch_deg=8.0, camera_fovy_deg=60.0)
    view = CanonicalView()
    data = _loaded(tmp_path, view)
    assert data.pictures is not None
    # The original images of both episodes are equal.
    assert (data.pictures[0] != data.pictures[60]).any()
    assert "looks 0 degrees down" in view.note()
    assert "and looks 8 degrees down with a vertical field of view of 60" in view.note()


def test_a_recording_without_motion_needs_the_response(tmp_path: Path) -> None:
    """A recording without speeds, or of a vehicle at rest, needs `--response`."""
    data = _loaded(_record(tmp_path / "none", state=None))
    with pytest.raises(DemosError, match=r"lacks steering/applied, speed, yaw_rate: give --resp"):
        as_waypoints(data)
    assert as_waypoints(data, SteeringResponse(1.9, 0.0)).kept.sum() == 50
    with pytest.raises(DemosError, match="but the recording has no speed"):
        as_waypoints(data, SteeringResponse(0.8, 0.9))
    data = _loaded(_record(tmp_path / "moves"))
    assert as_waypoints(data, SteeringResponse(0.8, 3.1)).kept.sum() == 60
    data = _loaded(_record(tmp_path / "stands", 10))
    with pytest.raises(DemosError, match=r"drive curves to both sides: give --response RAD_PER_M"):
        as_waypoints(data)
    with pytest.raises(DemosError, match=r"In no step .* drive forward"):
        as_waypoints(data, SteeringResponse(1.9, 0.0))


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"camera_pitch_deg": None}, "does not state pitch and field of view .* give --camera"),
        ({"camera_fovy_deg": 0.0}, "above 0 and below 180, got 0 and 0"),
        ({"camera_fovy_deg": 20.0}, "misses"),
        ({"action_layout": ACTION_LAYOUT}, "omit --waypoints"),
        ({"action_layout": Layout((Feature("left", "1"), Feature("right", "1")))}, "left, right"),
    ],
)
def test_unsuitable_recordings_are_refused(
    tmp_path: Path, changes: dict[str, Any], why: str
) -> None:
    data, out = _record(tmp_path / "drive", **changes), tmp_path / "policy.safetensors"
    with pytest.raises((DemosError, WorldError), match=why):
        DemosTrain(data, out, waypoints=True).run()
    assert not out.exists()


def test_several_bodies_and_no_pictures_are_refused(tmp_path: Path) -> None:
    _record(tmp_path / "two")
    _record(tmp_path / "two", body="truck")
    with pytest.raises(DemosError, match="several bodies, car, truck"):
        _loaded(tmp_path / "two")
    header = EpisodeHeader(action_layout=_ACTIONS, clock="none")
    with EpisodeWriter.create(tmp_path / "blind", header) as writer:
        writer.add(Step(action=(0.0, 0.5), driver="person"))
        writer.close()
    with pytest.raises(DemosError, match="have no images"):
        as_waypoints(_loaded(tmp_path / "blind"))


def test_options_that_contradict_each_other_are_refused(tmp_path: Path) -> None:
    data, out = tmp_path / "drive", tmp_path / "policy.safetensors"
    with pytest.raises(DemosError, match="need --waypoints"):
        DemosTrain(data, out, camera=(0.0, 48.8)).run()
    with pytest.raises(DemosError, match="leave out --head and --inputs"):
        DemosTrain(data, out, waypoints=True, inputs="state").run()
    with pytest.raises(WorldError, match="above 0 and below 180, got 95 and 48"):
        DemosTrain(data, out, waypoints=True, camera=(95.0, 48.0)).run()


@pytest.mark.gl
@pytest.mark.usefixtures("gl")
def test_a_recorded_car_teaches_a_policy_for_a_tank(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out = tmp_path / "drive", tmp_path / "policy.safetensors"
    main(["demos", "record", "Car", "--out", str(data), "--minutes", "0.1"])
    main(["demos", "train", str(data), "--out", str(out), "--waypoints"])
    assert "looks 0 degrees down" in capsys.readouterr().out
    policy = load_policy(out)
    with closing(WaypointEnv("tank", put_back=True)) as env:
        policy.card.require_layouts(env.action_layout)
        seen, _ = env.reset(options={"course": 2, "start": 2})
        assert env.action_space.contains(policy.predict(seen))
