"""Import of LeRobot datasets, version 3: our own with their layouts, and those of others.

Of a dataset of others, `action` becomes the action, the numbers of `observation.*` become the
state, and one camera the picture. Units are unknown and written "?", unless the feature states
them, and the driver is taken to be a person, who teleoperated the robot. Pictures that are stored
as JPEG are kept; videos and PNGs are encoded as JPEG of quality 100, which changes them slightly.
"""

from __future__ import annotations

import io
import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, Driver, EpisodeHeader, Step
from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES
from shapechanger.demos.exchange import lerobot_export as names
from shapechanger.demos.exchange.files import (
    library,
    parse_json_object,
    read_text,
)
from shapechanger.demos.exchange.format import ExchangeEpisode, ExchangeStep, ImportContext
from shapechanger.demos.exchange.lerobot_features import (
    DatasetFeature,
    ImportedFeatures,
    layout_of,
    read_features,
)
from shapechanger.demos.exchange.lerobot_index import LocatedEpisode, locate, read_places
from shapechanger.demos.exchange.lerobot_tables import (
    MAX_PACKED,
    MAX_UNPACKED,
    UnpacksToTooMuch,
    inside,
    rows_at,
    table_rows,
)
from shapechanger.demos.exchange.pictures import Pictures
from shapechanger.demos.exchange.video import read_pictures
from shapechanger.demos.jpeg import encode_picture
from shapechanger.errors import DemosError, UnknownName

_VERSIONS: Final = "v3."
_JPEG: Final = b"\xff\xd8"
_PNG: Final = b"\x89PNG"
_PNG_DEPTH: Final = 24  # Position of the number of bits of a value.
_DEEP: Final = 16
_OPAQUE: Final = 255


def is_lerobot(folder: Path) -> bool:
    """Return whether a folder is a LeRobot dataset of any version."""
    return (folder / names.INFO).is_file()


def read_lerobot(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset.

    Args:
        folder: Folder of the dataset.
        context: Its `camera` is a name such as "front".

    Raises:
        DemosError: If something is damaged or missing, or cannot be imported.
        UnknownName: If there is no such camera.
        MissingExtra: If a package that is needed is not installed.
    """
    path = folder / names.INFO
    info = parse_json_object(read_text(path), str(path))
    version = str(info.get("codebase_version", "unknown"))
    if not version.startswith(_VERSIONS):
        raise DemosError(
            f"{folder} has version {version} of LeRobot's format, and only 3 can be imported: "
            "convert it with `python -m lerobot.datasets.v30.convert_dataset_v21_to_v30` of "
            "lerobot 0.4, which converts v2.1."
        )
    kept = ImportedFeatures.of(read_features(info, path), context, path)
    rate = info.get("fps")
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < math.inf:
        raise DemosError(f"{path}: fps must be a positive number, got {rate!r}.")
    camera = kept.picture
    header = EpisodeHeader(
        action_layout=layout_of([kept.action], context).to_json(),
        state_layout=layout_of(kept.states, context).to_json() if kept.states else "",
        image_size=None if camera is None else camera.picture_size(path),
        control_hz=float(rate),
        robot=str(info.get("robot_type") or ""),
        source="lerobot",
        notes={"dataset": folder.resolve().name}
        | ({} if camera is None else {"camera": camera.key}),
    )
    tasks = _tasks(folder)
    video = camera.key if camera is not None and camera.kind == "video" else ""
    places, twice = read_places(folder, video, context)
    _require_counts(info, places, context)
    own = _own_headers(folder, places[-1]["episode_index"] + 1 if places else 0)
    unpacked: dict[Path, int] = {}
    for located in locate(folder, info, places, twice, video, header.image_size, context):
        about, drivers, outcome = header, _Drivers([]), ""
        task = located.place.get("tasks")
        said = ", ".join(map(str, cast("list[Any]", task))) if isinstance(task, list) else ""
        if said or len(tasks) == 1:
            about = replace(about, notes=about.notes | {"task": said or tasks[0]})
        if own:
            about, drivers, outcome = _own_header(
                own[located.number], about, folder, located.number
            )
        yield ExchangeEpisode(
            header=about,
            rows=_rows(located, kept, about, drivers, context, unpacked),
            name=f"{folder}, episode {located.number}",
            outcome=outcome,
        )


def _require_counts(
    info: dict[str, Any], places: Sequence[dict[str, Any]], context: ImportContext
) -> None:
    """Report totals in `info.json` that differ from `meta/episodes`."""
    counted = {
        "total_episodes": len(places),
        "total_frames": sum(place["length"] for place in places),
    }
    for key, count in counted.items():
        if key in info and info[key] != count:
            context.warn(f"{names.INFO} has {key} {info[key]}, and {names.EPISODES} {count}.")


def _own_headers(folder: Path, count: int) -> list[dict[str, Any]]:
    """Return the headers of a dataset that Shapechanger exported; [] for one of others."""
    path = folder / names.HEADERS
    if not path.is_file():
        return []
    fields = parse_json_object(read_text(path), str(path))
    headers = fields.get("episodes")
    if fields.get("format") != names.HEADERS_FORMAT or not isinstance(headers, list):
        raise DemosError(
            f"{path} was written by another version of Shapechanger: this one reads format "
            f"{names.HEADERS_FORMAT} only."
        )
    plain = cast("list[Any]", headers)
    if len(plain) != count or not all(isinstance(header, dict) for header in plain):
        raise DemosError(
            f"{path} describes {len(plain)} episodes, and the dataset has {count}: remove it if "
            "the dataset was edited."
        )
    return plain


def _own_header(
    plain: dict[str, Any], found: EpisodeHeader, folder: Path, number: int
) -> tuple[EpisodeHeader, _Drivers, str]:
    """Return the header of an own episode, the driver of each step, and the outcome."""
    where = f"{folder / names.HEADERS}, episode {number}"
    try:
        header = EpisodeHeader.from_json(plain)
        runs = [(str(driver), int(count)) for driver, count in plain.get("drivers", [])]
    except (DemosError, TypeError, ValueError) as error:
        raise DemosError(f"{where}: {error}") from error
    for driver, _ in runs:
        if driver not in DRIVERS:
            raise DemosError(f"{where}: {UnknownName('driver', driver, DRIVERS)}")
    ours, theirs = ((one.action_size, one.state_size, one.image_size) for one in (header, found))
    if ours != theirs:
        raise DemosError(
            f"{where} is of another dataset, with other actions, states or pictures: remove the "
            "file if the dataset was edited."
        )
    # The times are those of the dataset.
    clock = "real" if header.clock == "none" else header.clock
    header = replace(header, clock=clock, notes=found.notes | header.notes)
    return header, _Drivers(cast("list[tuple[Driver, int]]", runs)), str(plain.get("outcome", ""))


class _Drivers:
    """The driver of each step.

    Args:
        runs: Drivers, each with a number of consecutive steps; a person drives after them.
    """

    def __init__(self, runs: Sequence[tuple[Driver, int]]) -> None:
        self._drivers: list[Driver] = [driver for driver, _ in runs]
        self._ends = list(accumulate(count for _, count in runs))

    def of(self, step: int) -> Driver:
        """Return who drove a step."""
        run = bisect_right(self._ends, step)
        return self._drivers[run] if run < len(self._drivers) else "person"


def _tasks(folder: Path) -> list[str]:
    """Return the texts of the tasks, in order; [] if there is no such file."""
    path = folder / names.TASKS
    if not path.is_file():
        return []
    rows = table_rows(inside(folder, names.TASKS, path), None)
    texts = [[value for value in row.values() if isinstance(value, str)] for row in rows]
    return [text[0] for text in texts if text]


def _rows(
    located: LocatedEpisode,
    kept: ImportedFeatures,
    header: EpisodeHeader,
    drivers: _Drivers,
    context: ImportContext,
    unpacked: dict[Path, int],
) -> Iterator[ExchangeStep]:
    """Yield the steps of an episode; `unpacked` counts the bytes of pictures of each file."""
    pictures = _Pictures(located, kept.picture, header.image_size, unpacked)
    frames = located.frames.tolist()
    left_from, reason = 0, ""
    try:
        for number, row in enumerate(_in_order(located, kept)):
            frame = frames[number]
            try:
                jpeg = pictures.of(number, row)
                if not np.isfinite(row[names.ACTION]).all():
                    raise _BadStep("with an action that is not finite")
            except _BadStep as found:
                context.leave_out("step", str(found), f"{frame} of episode {located.number}")
                left_from = number + 1
                continue
            reward = float(row[names.REWARD][0]) if names.REWARD in row else math.nan
            done = names.DONE in row and bool(row[names.DONE][0])
            ended = bool(row[names.TERMINATED][0]) if names.TERMINATED in row else done
            step = Step(
                action=tuple(row[names.ACTION].tolist()),
                driver=drivers.of(frame),
                state=tuple(value for f in kept.states for value in row[f.key].tolist()),
                captured_ns=int(located.times_ns[number]),
                reward=None if math.isnan(reward) else reward,
                terminated=ended,
                truncated=done and not ended,
            )
            left_from = number + 1
            yield ExchangeStep(step=step, jpeg=pictures.unless_shown(jpeg))
    except UnpacksToTooMuch:
        raise
    except DemosError as error:
        reason = f"that cannot be read: {str(error).removesuffix('.')}"
    for frame in frames[left_from:]:
        context.leave_out("step", reason, f"{frame} of episode {located.number}")


def _in_order(located: LocatedEpisode, kept: ImportedFeatures) -> Iterator[dict[str, Any]]:
    """Yield the features of each step in order: vectors, and pictures as stored."""
    sizes = {f.key: f.size for f in (kept.action, *kept.states)} | dict.fromkeys(kept.columns, 1)
    stored = [kept.picture.key] if kept.picture is not None and kept.picture.kind == "image" else []
    waiting: dict[int, dict[str, Any]] = {}  # Rows of a file that is not in order.
    due = held = 0
    for path, (places, rows) in located.rows.items():
        for place, row in zip(places.tolist(), rows_at(path, rows, sizes, stored), strict=True):
            waiting[place] = row
            held += _bytes_of(row, stored)
            while due in waiting:
                held -= _bytes_of(waiting[due], stored)
                yield waiting.pop(due)
                due += 1
            if held > MAX_UNPACKED:  # Many rows may share one large value.
                raise DemosError(f"{path} has pictures too far out of order: sort its rows.")


def _bytes_of(row: dict[str, Any], stored: Sequence[str]) -> int:
    """Return the size of the pictures of a row, bytes."""
    pictures = [cast("dict[str, Any]", row[key] or {}).get("bytes") for key in stored]
    return sum(len(picture) for picture in pictures if isinstance(picture, bytes))


class _BadStep(Exception):
    """Why a step is left out, to follow "steps"."""


class _Pictures:
    """The pictures of the steps of an episode.

    Args:
        located: The episode.
        picture: The feature with its pictures; None without any.
        size: Width and height that they must have, pixels.
        unpacked: Bytes of pictures read from each file so far.
    """

    def __init__(
        self,
        located: LocatedEpisode,
        picture: DatasetFeature | None,
        size: tuple[int, int] | None,
        unpacked: dict[Path, int],
    ) -> None:
        self._feature = picture
        self._check = Pictures(size)
        self._unpacked = unpacked
        self._frames: Iterator[NDArray[np.uint8]] | None = None
        self._files = list(located.rows)
        self._read = b""
        self._jpeg: bytes | None = None
        self._fault = ""
        self._shown: bytes | None = None
        if located.video is not None and located.times is not None and size is not None:
            wanted = located.ticks.tolist()
            self._frames = read_pictures(located.video, located.times, wanted, size)

    def of(self, number: int, row: dict[str, Any]) -> bytes | None:
        """Return the picture of a step as JPEG.

        Args:
            number: Number of the step among those of the episode.
            row: Its features.
        """
        if self._frames is not None:
            return encode_picture(next(self._frames))
        if self._feature is None:
            return None
        data = _stored(row[self._feature.key])
        if data != self._read:  # Else the steps share a picture.
            self._count(len(data))
            self._read, self._fault = data, ""
            try:
                self._jpeg = _as_jpeg(data, self._check)
            except _BadStep as error:
                self._fault = str(error)
        if self._fault:
            raise _BadStep(self._fault)
        return self._jpeg

    def unless_shown(self, jpeg: bytes | None) -> bytes | None:
        """Return the picture of a step that is imported; None if it is that of the one before."""
        if jpeg is self._shown:
            return None
        self._shown = jpeg
        return jpeg

    def _count(self, size: int) -> None:
        """Refuse files that unpack to too much: one picture can stand in any number of rows."""
        path = self._files[0]
        most = MAX_UNPACKED + MAX_PACKED * sum(file.stat().st_size for file in self._files)
        self._unpacked[path] = self._unpacked.get(path, 0) + size
        if self._unpacked[path] > most:
            raise UnpacksToTooMuch(f"{path} unpacks to more than {most} bytes of pictures.")


def _stored(stored: Any) -> bytes:
    """Return the bytes of a picture of a table."""
    data = cast("dict[str, Any]", stored).get("bytes") if isinstance(stored, dict) else None
    if not isinstance(data, bytes) or not data:
        raise _BadStep("whose picture is not in the table")
    if len(data) > MAX_PICTURE_BYTES:
        raise _BadStep(f"with a picture of more than {MAX_PICTURE_BYTES} bytes")
    return data


def _as_jpeg(data: bytes, pictures: Pictures) -> bytes:
    """Return a picture as JPEG."""
    if data.startswith(_JPEG):
        try:
            pictures.check(data, "in the table")
        except DemosError as error:
            why = str(error).removesuffix(".")
            raise _BadStep(f"with a picture that cannot be taken: {why}") from error
        return data
    if not data.startswith(_PNG):
        raise _BadStep("with a picture that is neither JPEG nor PNG")
    if data[_PNG_DEPTH : _PNG_DEPTH + 1] == bytes([_DEEP]):
        raise _BadStep("with a picture of 16 bits a value, like that of a depth camera")
    image = library("PIL.Image", "lerobot")
    try:
        with image.open(io.BytesIO(data), formats=["PNG"]) as opened:
            if pictures.size is not None and opened.size != pictures.size:
                (width, height), (wanted, high) = opened.size, pictures.size
                raise _BadStep(
                    f"with a picture of {width} x {height} pixels, and not {wanted} x {high} as "
                    "meta/info.json says"
                )
            if (
                opened.has_transparency_data
                and np.asarray(opened.convert("RGBA"))[..., 3].min() < _OPAQUE
            ):
                raise _BadStep("with a picture that is partly transparent")
            pixels = np.asarray(opened.convert("RGB"))
    except (OSError, ValueError, SyntaxError) as error:
        raise _BadStep(f"with a damaged picture ({error})") from error
    return encode_picture(pixels)
