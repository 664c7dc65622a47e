"""Features of LeRobot datasets: each feature is imported unchanged, or named in the report."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from shapechanger.demos.exchange import import_recording
from shapechanger.errors import DemosError, UnknownName
from tests.demos.exchange.lerobot_set import (
    CAMERA,
    DATA,
    SIZE,
    VIDEO,
    pairs_of,
    write_set,
    write_video,
)
from tests.demos.exchange.small import all_of, findings_of, image_file

AXES = ["height", "width", "channels"]
COUNT = 16


def plain(number: int, channels: int = 3) -> np.ndarray:
    """Return an image whose brightness shows its number."""
    return np.full((SIZE, SIZE, channels), 6 * number, np.uint8).squeeze()


def stored(images: list[Any], feature: dict[str, Any] | None = None) -> dict[str, Any]:
    column = pa.array([{"bytes": data, "path": f"{n}.png"} for n, data in enumerate(images)])
    described = {"dtype": "image", "shape": [SIZE, SIZE, 3], "names": AXES} | (feature or {})
    return {"video": False, "columns": {CAMERA: column}, "features": {CAMERA: described}}


def test_a_picture_that_steps_share_is_stored_once(tmp_path: Path) -> None:
    images = [image_file(plain(n // 4)) for n in range(COUNT)]

    def spoil(rows: list[dict[str, Any]]) -> None:
        rows[4]["action"] = [4.0, float("nan")]

    folder = write_set(tmp_path / "set", rows=spoil, **stored(images))
    done = import_recording(folder, tmp_path / "back")
    assert [len(list(one.path.glob("frames/*"))) for one in all_of(tmp_path / "back")] == [2, 2]
    assert findings_of(done) == "left out: step 4 of episode 0: its action is [4.0, nan]"


@pytest.mark.parametrize(
    ("shape", "named"),
    [([3, SIZE, 16], AXES), ([SIZE, 16, 3], None), ([3, SIZE, 16], None), ([SIZE, 16], None)],
)
def test_axes_are_found_by_the_number_of_colours(
    tmp_path: Path, shape: list[int], named: list[str] | None
) -> None:
    images = [image_file(plain(n)[:, :16]) for n in range(COUNT)]
    options = stored(images, {"shape": shape, "names": named})
    import_recording(write_set(tmp_path / "set", **options), tmp_path / "back")
    assert {one.header.image_size for one in all_of(tmp_path / "back")} == {(16, SIZE)}


def test_other_features_are_named(tmp_path: Path) -> None:
    numbers = pa.array([[[[7]] * 4] * 4] * COUNT, pa.list_(pa.list_(pa.list_(pa.uint16()))))
    folder = write_set(
        tmp_path / "set",
        features={
            "observation.images.depth": {"dtype": "uint16", "shape": [4, 4, 1], "names": AXES},
            "observation.points": {"dtype": "float32", "shape": [480, 640, 3], "names": None},
            "observation.scan": {"dtype": "depth16", "shape": [480, 640], "names": None},
            "observation.words": {"dtype": "string", "shape": [1], "names": None},
            "next.success": {"dtype": "bool", "shape": [1], "names": None},
        },
        columns={"observation.images.depth": numbers, "extra": numbers},
    )
    pairs, context = pairs_of(folder)
    assert sum(map(len, pairs)) == COUNT
    assert findings_of(context).splitlines() == [
        "note: The feature observation.images.depth (uint16, 4 x 4 x 1) is not imported.",
        "note: The feature observation.points (float32, 480 x 640 x 3) is not imported.",
        "note: The feature observation.scan (depth16, 480 x 640) is not imported.",
        "note: The feature observation.words (string, 1) is not imported.",
        "note: The feature next.success (bool, 1) is not imported.",
        "note: The column extra is not imported.",
    ]


@pytest.mark.parametrize("flag", ["video.is_depth_map", "is_depth_map"])
def test_a_camera_of_depth_is_not_chosen(tmp_path: Path, flag: str) -> None:
    depth = {"dtype": "video", "shape": [SIZE, SIZE, 1], "names": AXES, "info": {flag: True}}
    folder = write_set(tmp_path / "set", features={"observation.images.depth": depth})
    _, context = pairs_of(folder)
    assert "depth (video, 32 x 32 x 1) is not imported" in findings_of(context)
    with pytest.raises(UnknownName, match="There are: front"):
        pairs_of(folder, "depth")


def test_a_video_of_depth_is_refused(tmp_path: Path) -> None:
    folder = write_set(tmp_path / "set")
    write_video(folder / VIDEO, range(COUNT), 20, "-c:v", "ffv1", "-pix_fmt", "gray16le")
    with pytest.raises(DemosError, match=r"more than 8 bits \(gray16le\)"):
        import_recording(folder, tmp_path / "back")


@pytest.mark.parametrize(
    ("named", "expected", "noted"),
    [
        (["pan", "tilt"], ("pan", "tilt"), False),
        ({"motors": ["pan", "tilt"]}, ("pan", "tilt"), False),
        ({"tilt": 1, "pan": 0}, ("pan", "tilt"), False),
        (["pan", "tilt", "grip"], ("action/0", "action/1"), True),
        (["pan", "pan"], ("action/0", "action/1"), True),
        (None, ("action/0", "action/1"), False),
    ],
)
def test_names_and_units_of_values(
    tmp_path: Path, named: Any, expected: tuple[str, ...], noted: bool
) -> None:
    action = {"dtype": "float32", "shape": [2], "names": named, "units": ["rad", "deg"]}
    folder = write_set(tmp_path / "set", video=False, features={"action": action})
    done = import_recording(folder, tmp_path / "back")
    episode = all_of(tmp_path / "back")[0]
    about = episode.header
    assert about.notes == {"dataset": "set", "task": "drive"}
    assert {step.driver for step in episode.steps} == {"person"}
    assert about.created == ""  # The start time is unknown.
    layout = about.action_layout
    assert (layout.names, [feature.unit for feature in layout]) == (expected, ["rad", "deg"])
    assert ("names of action do not fit its 2 values" in findings_of(done)) == noted


def test_one_of_several_cameras(tmp_path: Path) -> None:
    """Several cameras require a choice, by the short or the complete name."""
    camera = {"dtype": "video", "shape": [SIZE, SIZE, 3], "names": AXES}
    folder = write_set(tmp_path / "set", features={"observation.images.wrist": camera})
    with pytest.raises(DemosError, match=r"2 cameras: choose one of front, wrist by --camera"):
        import_recording(folder, tmp_path / "back")
    with pytest.raises(UnknownName, match="Did you mean 'wrist'"):
        import_recording(folder, tmp_path / "back", camera="wirst")
    assert pairs_of(folder, "front")[0] == pairs_of(folder, CAMERA)[0]


def spoil(name: str, content: bytes | None = None, size: int | None = None) -> Any:
    def change(folder: Path) -> None:
        path = folder / name
        path.write_bytes(path.read_bytes()[:size] if content is None else content)

    return change


def outside(folder: Path) -> None:
    shutil.move(folder / DATA, folder.parent / "moved.parquet")
    (folder / DATA).symlink_to(folder.parent / "moved.parquet")


NUMBER = {"dtype": "float32", "shape": [3]}
PLAYLIST = b"#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n"


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"info": {"codebase_version": "v2.1"}}, "version v2.1.*convert_dataset_v21"),
        ({"info": {"fps": 0}}, r"Expected `float` > 0.0 - at `\$.fps`"),
        ({"info": {"data_path": "../../{chunk_index}"}}, "leaves the folder"),
        ({"info": {"data_path": "{chunk_index:99d}"}}, "have 0 of the 8 rows of episode 0"),
        ({"info": {"data_path": None}}, "Expected `str`, got `null`.*data_path"),
        ({"info": {"data_path": "**/*"}}, "have 0 of the 8 rows of episode 0"),
        ({"info": {"video_path": "/etc/{video_key}"}}, "episode 0.*leaves the folder"),
        ({"features": {"action": {"dtype": "string", "shape": [1]}}}, "no numeric feature"),
        ({"features": {"action": NUMBER}}, "A row of 'action' does not have 3 numbers"),
        ({"features": {"observation.x": NUMBER}}, "no column 'observation.x'"),
        ({"features": {CAMERA: {"dtype": "video", "shape": [16, SIZE, 3]}}}, r"not \(32, 16\)"),
        ({"features": {CAMERA: {"dtype": "video", "shape": [7]}}}, "the shape .7., not"),
        (spoil(DATA, size=300), "not an intact Parquet file"),
        (spoil(VIDEO, PLAYLIST), "episode 0.*is damaged"),
        (outside, "leaves the folder"),
        (lambda folder: shutil.rmtree(folder / "meta/episodes"), "not have each episode once"),
    ],
)
def test_refused_imports(tmp_path: Path, options: Any, message: str) -> None:
    """No folder is left behind."""
    folder = write_set(tmp_path / "set", **({} if callable(options) else options))
    if callable(options):
        options(folder)
    with pytest.raises(DemosError, match=message):
        import_recording(folder, tmp_path / "back")
    assert not [path.name for path in tmp_path.iterdir() if "back" in path.name]
