"""MCAP files, read by MCAP's own reader with its checks of CRCs."""

from __future__ import annotations

import base64
import json
import math
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from shapechanger.demos.episodes import Drop, EpisodeWriter, Step, edit
from shapechanger.demos.exchange import export_recording, import_recording
from shapechanger.errors import UnknownName
from shapechanger.layout import Feature, Layout
from tests.demos.exchange.small import drive, header, picture

Message = tuple[str, int, dict[str, Any]]


def messages(path: Path) -> list[Message]:
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        return [
            (channel.topic, message.log_time, json.loads(message.data))
            for _, channel, message in reader.iter_messages()
        ]


def of(found: list[Message], topic: str) -> list[tuple[int, dict[str, Any]]]:
    return [(at, content) for name, at, content in found if name == topic]


@pytest.fixture
def exported(tmp_path: Path) -> Path:
    layout = Layout((Feature("speed", "m/s", 0.0, 4.0), Feature("map", "1", shape=(2,))))
    rest: dict[str, Any] = {"action": (0.0, 0.0), "driver": "person"}
    steps = [
        Step(
            action=(0.5, -1 / 3),
            driver="person",
            applied=(0.25, 0.0),
            state=(math.nan, 1.0, math.inf),
            captured_ns=7 * 10**9 + 5,
            decided_ns=7 * 10**9 + 9,
            wall_ns=1_700_000_000_000_000_001,
            reward=1.5,
            terms={"speed": 2.0, "ü": math.nan},
        ),
        Step(action=(0.0, 0.0), driver="policy", wanted=(0.1, 0.2), state=(2.0, 3.0, 4.0)),
        Step(**rest, state=(1.0,) * 3, terminated=True, stop_reason="x"),
    ]
    about = header(state_layout=layout, control_hz=10.0)
    with EpisodeWriter.create(tmp_path / "data", about) as writer:
        for n, step in enumerate(steps):
            writer.add(step, None if n == 1 else picture(n))
        writer.mark("here")
        writer.close("time")
    edit(writer.path, Drop(1, 1, "bad"))
    export_recording(tmp_path / "data", tmp_path / "out", "mcap", dropped=True)
    return tmp_path / "out/episode-0001.mcap"


def test_every_value_is_there(exported: Path) -> None:
    """Each topic has its values, at the robot's times; missing times follow from the rate."""
    found = messages(exported)
    start = 7 * 10**9 + 5
    times = [at for at, _ in of(found, "/state")]
    assert times == [start, start + 10**8, start + 2 * 10**8]
    # Quantities without a measurement are left out, or null in an array.
    assert [content for _, content in of(found, "/state")] == [
        {"map": [1.0, None]},
        {"speed": 2.0, "map": [3.0, 4.0]},
        {"speed": 1.0, "map": [1.0, 1.0]},
    ]
    assert of(found, "/action")[0] == (start + 4, {"steering": 0.5, "throttle": -1 / 3})
    assert of(found, "/applied") == [(start + 4, {"steering": 0.25, "throttle": 0.0})]
    assert of(found, "/wanted") == [(start + 10**8, {"steering": 0.1, "throttle": 0.2})]
    terms = {"speed": 2.0, "ü": None}
    assert of(found, "/reward") == [(start + 4, {"reward": 1.5, "terms": terms})]
    plain = {"terminated": False, "truncated": False}
    end = {"stop_reason": "x", "marks": ["here"]}
    assert [content for _, content in of(found, "/step")] == [
        {"step": 0, "driver": "person", **plain, "wall_ns": 1_700_000_000_000_000_001},
        {"step": 1, "driver": "policy", **plain, "dropped": "bad"},
        plain | {"step": 2, "driver": "person", "terminated": True} | end,
    ]
    pictures = of(found, "/camera")
    jpegs = [base64.b64decode(content["data"]) for _, content in pictures]
    assert jpegs == [picture(0), picture(2)]
    assert pictures[0][1]["timestamp"] == {"sec": 7, "nsec": 5}
    assert {content["format"] for _, content in pictures} == {"jpeg"}


@pytest.mark.parametrize(
    ("clock_ns", "expected_ns"),
    [
        ([None, None, 900, 1000], [0, 100, 900, 1000]),
        ([None, None], [0, 100]),
        ([500, None, None, 300], [500, 600, 700, 300]),  # Times are kept if the clock jumps back.
        ([-5, None, 250], [0, 100, 250]),
    ],
)
def test_unknown_times_follow_at_the_rate(
    tmp_path: Path, clock_ns: list[int | None], expected_ns: list[int]
) -> None:
    about = header(state_layout=Layout(()), image_size=None, control_hz=10.0)
    with EpisodeWriter.create(tmp_path / "data", about) as writer:
        for n, at in enumerate(clock_ns):
            at_ns = None if at is None else at * 10**6
            writer.add(Step(action=(n / 10, 0.0), driver="person", captured_ns=at_ns), None)
        writer.close("time")
    export_recording(tmp_path / "data", tmp_path / "out", "mcap")
    found = of(messages(tmp_path / "out/episode-0001.mcap"), "/action")
    times = {round(10 * content["steering"]): at / 10**6 for at, content in found}
    assert [times[n] for n in range(len(clock_ns))] == expected_ns


def test_schemas_and_metadata(exported: Path) -> None:
    """Schemas name each quantity and its unit; the header is kept."""
    with exported.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        schemas = {schema.name: schema for schema in summary.schemas.values()}
        assert {schema.encoding for schema in schemas.values()} == {"jsonschema"}
        assert "foxglove.CompressedImage" in schemas
        state = json.loads(schemas["shapechanger.State"].data)["properties"]
        assert state["speed"] == {"type": "number", "description": "[m/s] 0 to 4"}
        assert state["map"]["type"] == "array"
        assert {channel.message_encoding for channel in summary.channels.values()} == {"json"}
        (metadata,) = reader.iter_metadata()
    assert metadata.name == "shapechanger"
    assert metadata.metadata["outcome"] == "time"
    assert json.loads(metadata.metadata["header"])["driver"] == "Ada"


def test_a_file_for_each_episode_and_no_import(tmp_path: Path) -> None:
    for count in (3, 2):
        drive(tmp_path / "data", count)
    assert export_recording(tmp_path / "data", tmp_path / "out", "mcap").steps == 5
    counts = [len(of(messages(path), "/step")) for path in sorted((tmp_path / "out").iterdir())]
    assert counts == [3, 2]
    with pytest.raises(UnknownName, match="There are: auto, tub, minari, lerobot, csv"):
        import_recording(tmp_path / "out", tmp_path / "back", "mcap")
