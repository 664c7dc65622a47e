"""Import of LeRobot datasets, version 3: our own with their layouts, and those of others.

Of a dataset of others, `action` becomes the action, the numbers of `observation.*` become the
state, and one camera the picture. Units are unknown and written "?", and the driver is taken to be
a person, who teleoperated the robot. Pictures that are stored as JPEG are kept; videos and PNGs are
encoded as JPEG of quality 100, which changes them slightly.
"""

from __future__ import annotations

import io
import math
import re
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain, repeat
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, Driver, EpisodeHeader, Step
from shapechanger.demos.episodes.files import MAX_PICTURE_BYTES
from shapechanger.demos.exchange import lerobot_export as names
from shapechanger.demos.exchange.files import (
    Pictures,
    library,
    parse_json_object,
    read_text,
)
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.recorded import ExchangeEpisode, ExchangeStep
from shapechanger.demos.exchange.video import read_video
from shapechanger.demos.jpeg import MAX_PIXELS, encode_picture
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

_VERSIONS: Final = "v3."
_OBSERVATION: Final = "observation."
_CAMERAS: Final = "observation.images."
_PICTURES: Final = ("video", "image")
_NUMBERS: Final = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)")
_UNIT_UNKNOWN: Final = "?"
_MAX_FEATURES: Final = 512  # A larger vector becomes one array feature.
_MAX_VALUES: Final = 1 << 17
_ROWS: Final = 256  # In memory at once; fewer if the values of a column are large.
# A few bytes of Parquet can claim any number of values. Of what is read, bytes at once, and the
# largest share of unpacked bytes to those of the file.
_MAX_UNPACKED: Final = 64 << 20
_MAX_PACKED: Final = 64
_MAX_TEXT: Final = 4096  # Characters of a task.
_PLACE: Final = re.compile(r"\{(video_key|chunk_index|file_index)(?::0?(\d)d)?\}")
_JPEG: Final = b"\xff\xd8"
_PNG: Final = b"\x89PNG"


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
            "convert it with `python -m lerobot.datasets.v30.convert_dataset_v21_to_v30`."
        )
    features = _features(info, path)
    kept = _Kept.of(features, context.camera, path)
    rate = info.get("fps")
    if isinstance(rate, bool) or not isinstance(rate, int | float) or not 0.0 < rate < math.inf:
        raise DemosError(f"{path}: fps must be a positive number, got {rate!r}.")
    header = EpisodeHeader(
        action_layout=_layout_of([kept.action]).to_json(),
        state_layout=_layout_of(kept.states).to_json() if kept.states else "",
        image_size=None if kept.picture is None else kept.picture.picture_size(path),
        control_hz=float(rate),
        robot=str(info.get("robot_type") or ""),
        clock="none",
        source="lerobot",
        notes={"dataset": folder.resolve().name}
        | ({} if kept.picture is None else {"camera": kept.picture.key}),
    )
    tasks = _tasks(folder)
    episodes = _episodes(folder, kept)
    own = _own_headers(folder, len(episodes))
    unpacked: dict[Path, int] = {}
    for number, place in enumerate(episodes):
        about = header
        task = place.get("tasks")
        said = ", ".join(map(str, cast("list[Any]", task))) if isinstance(task, list) else ""
        if said or tasks:
            about = replace(about, notes=about.notes | {"task": said or tasks[0]})
        drivers: Iterator[Driver] = repeat("person")
        outcome = ""
        if own:
            about, drivers, outcome = _own_header(own[number], about, folder, number)
        yield ExchangeEpisode(
            header=about,
            rows=_rows(folder, info, place, kept, about, drivers, unpacked),
            name=f"{folder}, episode {number}",
            outcome=outcome,
        )


@dataclass(frozen=True, slots=True)
class _Feature:
    """A feature of `info.json`.

    Attributes:
        key: Its key, such as "observation.state".
        kind: Its dtype.
        shape: Its shape.
        names: Names of its values, or of its axes; () if there are none.
    """

    key: str
    kind: str
    shape: tuple[int, ...]
    names: tuple[str, ...]

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)

    def picture_size(self, path: Path) -> tuple[int, int]:
        """Return the width and height of its pictures, pixels.

        Raises:
            DemosError: If the shape is not that of a picture.
        """
        shape = self.shape
        if len(shape) == 3 and shape[0] in {1, 3} and self.names[:1] != ("height",):
            shape = (*shape[1:], shape[0])  # Colours first.
        if len(shape) != 3 or not 0 < shape[0] * shape[1] <= MAX_PIXELS:
            raise DemosError(f"{path}: {self.key} has the shape {list(shape)}, not of a picture.")
        return shape[1], shape[0]


@dataclass(frozen=True, slots=True)
class _Kept:
    """The features that are imported."""

    action: _Feature
    states: tuple[_Feature, ...]
    picture: _Feature | None
    columns: frozenset[str]

    @classmethod
    def of(cls, features: Sequence[_Feature], camera: str, path: Path) -> _Kept:
        """Choose features.

        Args:
            features: All features.
            camera: Name of the camera, such as "front"; "" for the only one.
            path: The file that they stand in, for errors.
        """
        numbers = {feature.key: feature for feature in features if _NUMBERS.fullmatch(feature.kind)}
        if names.ACTION not in numbers:
            raise DemosError(f"{path} has no numeric feature {names.ACTION!r}: there is no action.")
        states = [f for key, f in numbers.items() if key.startswith(_OBSERVATION)]
        states.sort(key=lambda feature: feature.key != names.STATE)  # Stable: the state first.
        more = {names.REWARD, names.DONE, names.TERMINATED}
        return cls(
            numbers[names.ACTION],
            tuple(states),
            _chosen([f for f in features if f.kind in _PICTURES], camera, path),
            frozenset(key for key in more if key in numbers and numbers[key].size == 1),
        )


def _chosen(cameras: Sequence[_Feature], camera: str, path: Path) -> _Feature | None:
    known = {feature.key.removeprefix(_CAMERAS): feature for feature in cameras}
    if camera:
        name = camera.removeprefix(_CAMERAS)
        if name not in known:
            raise UnknownName(f"camera of {path.parent.parent}", camera, known)
        return known[name]
    if len(known) > 1:
        raise DemosError(
            f"{path.parent.parent} has {len(known)} cameras ({', '.join(known)}), but an episode "
            f"has one: choose with --camera, such as --camera {next(iter(known))}."
        )
    return next(iter(known.values()), None)


def _features(info: dict[str, Any], path: Path) -> list[_Feature]:
    plain = info.get("features")
    found: list[_Feature] = []
    if not isinstance(plain, dict):
        raise DemosError(f"{path} has no features.")
    for key, feature in cast("dict[str, Any]", plain).items():
        try:
            shape = tuple(int(n) for n in feature["shape"])
            kind = str(feature["dtype"])
            named = _flat_names(feature.get("names"))
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise DemosError(f"{path}: the feature {key!r} has no dtype and shape.") from error
        if any(n < 1 for n in shape) or (kind not in _PICTURES and math.prod(shape) > _MAX_VALUES):
            raise DemosError(f"{path}: the feature {key!r} has the shape {list(shape)}.")
        found.append(_Feature(key, kind, shape, named))
    return found


def _flat_names(plain: Any) -> tuple[str, ...]:
    """Return names that are a list, or lists in a dictionary such as `{"motors": [...]}`."""
    if isinstance(plain, dict):
        parts = map(_flat_names, cast("dict[str, Any]", plain).values())
        return tuple(chain.from_iterable(parts))
    if isinstance(plain, list):
        return tuple(map(str, cast("list[Any]", plain)))
    return ()


def _layout_of(features: Sequence[_Feature]) -> Layout:
    """Return a layout for the values of features, in order."""
    found: list[Feature] = []
    for feature in features:
        key = feature.key.removeprefix(_OBSERVATION)
        prefix = "" if feature.key in {names.ACTION, names.STATE} else f"{key}/"
        named = tuple(prefix + name for name in feature.names)
        if len(set(named)) != feature.size or not all(feature.names):
            if feature.size > _MAX_FEATURES:
                found.append(Feature(key, _UNIT_UNKNOWN, shape=(feature.size,)))
                continue
            many = feature.size > 1
            named = tuple(f"{key}/{n}" for n in range(feature.size)) if many else (key,)
        found += [Feature(name, _UNIT_UNKNOWN) for name in named]
    if len({feature.name for feature in found}) < len(found):
        # Names that are not unique name nothing.
        found = [Feature(f"value/{n}", _UNIT_UNKNOWN) for n in range(sum(f.size for f in found))]
    return Layout(tuple(found))


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
) -> tuple[EpisodeHeader, Iterator[Driver], str]:
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
    # The steps come back without their times.
    header = replace(header, clock="none", notes=found.notes | header.notes)
    drivers = _drivers(cast("list[tuple[Driver, int]]", runs))
    return header, drivers, str(plain.get("outcome", ""))


def _drivers(runs: Sequence[tuple[Driver, int]]) -> Iterator[Driver]:
    """Yield the driver of each step."""
    for driver, count in runs:
        for _ in range(count):
            yield driver
    while True:
        yield "person"


def _tasks(folder: Path) -> list[str]:
    """Return the texts of the tasks, in order; [] if there is no such file."""
    path = folder / names.TASKS
    if not path.is_file():
        return []
    rows = _table(_inside(folder, names.TASKS, path), None)
    texts = [[value for value in row.values() if isinstance(value, str)] for row in rows]
    return [text[0] for text in texts if text]


def _episodes(folder: Path, kept: _Kept) -> list[dict[str, Any]]:
    """Return where each episode is, in order."""
    paths = sorted((folder / names.EPISODES).glob("*/*.parquet"))
    if not paths:
        raise DemosError(f"There is no {names.EPISODES}/*/*.parquet in {folder}: restore it.")
    columns = {"episode_index", "tasks", "length", "data/chunk_index", "data/file_index"}
    if kept.picture is not None and kept.picture.kind == "video":
        video = f"videos/{kept.picture.key}"
        columns |= {f"{video}/{n}" for n in ("chunk_index", "file_index", "from_timestamp")}
    found: list[dict[str, Any]] = []
    for path in paths:
        rows = _table(_inside(folder, str(path.relative_to(folder)), path), columns)
        for row in rows:
            if missing := sorted(column for column in columns if row.get(column) is None):
                raise DemosError(f"{path} has no {missing[0]!r}.")
            found.append(row)
    try:
        for row in found:
            row |= {key: int(row[key]) for key in columns if key.endswith(("index", "length"))}
    except (TypeError, ValueError) as error:
        raise DemosError(f"{folder / names.EPISODES} has an index that is no number.") from error
    found.sort(key=lambda row: row["episode_index"])
    if [row["episode_index"] for row in found] != list(range(len(found))):
        raise DemosError(f"{folder / names.EPISODES} does not number the episodes from 0.")
    return found


def _inside(folder: Path, name: str, named_by: Path) -> Path:
    """Return a file below a folder that a dataset names."""
    path = folder / name
    if not path.resolve().is_relative_to(folder.resolve()):
        raise DemosError(f"{named_by}: the name {name!r} leaves the folder.")
    if not path.is_file():
        raise DemosError(f"There is no {path}, which {named_by} names: restore it.")
    return path


def _place(template: object, info_path: Path, values: dict[str, Any]) -> str:
    """Fill in a path such as `data/chunk-{chunk_index:03d}/...`, without Python's own formats."""
    if not isinstance(template, str):
        raise DemosError(f"{info_path} does not say where the files are (data_path, video_path).")

    def filled(match: re.Match[str]) -> str:
        value = values.get(match[1], "")
        return str(value).rjust(int(match[2]), "0") if match[2] else str(value)

    return _PLACE.sub(filled, template)


@contextmanager
def _parquet(path: Path) -> Generator[Any]:
    """Open a Parquet file as a `pyarrow.parquet.ParquetFile`."""
    arrow = library("pyarrow", "lerobot")
    parquet = library("pyarrow.parquet", "lerobot")
    try:
        # Without `buffer_size` a whole row group is in memory, which may be an episode of pictures.
        with parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            size = path.stat().st_size
            columns = list(_columns_of(file, range(file.metadata.num_row_groups)))
            claimed = sum(max(c.total_uncompressed_size, 8 * c.num_values) for c in columns)
            if claimed > _MAX_UNPACKED + _MAX_PACKED * size or file.metadata.num_rows > size:
                raise DemosError(f"{path} has {size} bytes, but claims to unpack to {claimed}.")
            yield file
    except (arrow.ArrowException, OSError) as error:
        reason = str(error).splitlines()[0].rstrip(".") if str(error) else type(error).__name__
        raise DemosError(f"{path} is not an intact Parquet file: {reason}.") from error


def _columns_of(file: Any, groups: Iterable[int]) -> Iterator[Any]:
    """Yield the metadata of each column of some row groups."""
    for number in groups:
        group = file.metadata.row_group(number)
        yield from (group.column(n) for n in range(group.num_columns))


def _batches(file: Any, columns: Sequence[str], groups: Sequence[int]) -> Iterator[Any]:
    """Yield the rows of some row groups, a few at a time."""
    # Many rows may share one large value, which is in memory once for each.
    sizes = (max(c.total_uncompressed_size, 8 * c.num_values) for c in _columns_of(file, groups))
    largest = max(sizes, default=1)
    rows = max(1, min(_ROWS, _MAX_UNPACKED // max(1, largest)))
    return file.iter_batches(rows, row_groups=groups, columns=columns)


def _table(path: Path, columns: set[str] | None) -> list[dict[str, Any]]:
    """Return the rows of a table of `meta/`."""
    found: list[dict[str, Any]] = []
    with _parquet(path) as file:
        known = set(file.schema_arrow.names)
        wanted = sorted(known if columns is None else columns & known)
        for batch in _batches(file, wanted, range(file.metadata.num_row_groups)):
            for row in cast("list[dict[str, Any]]", batch.to_pylist()):
                if any(len(text) > _MAX_TEXT for text in _texts(row)):
                    raise DemosError(f"{path} has a text of more than {_MAX_TEXT} characters.")
                found.append(row)
    return found


def _texts(row: dict[str, Any]) -> Iterator[str]:
    """Yield the texts of a row, also those in lists."""
    for value in row.values():
        values = cast("list[Any]", value) if isinstance(value, list) else [value]
        yield from (text for text in values if isinstance(text, str))


def _rows(
    folder: Path,
    info: dict[str, Any],
    place: dict[str, Any],
    kept: _Kept,
    header: EpisodeHeader,
    drivers: Iterator[Driver],
    unpacked: dict[Path, int],
) -> Iterator[ExchangeStep]:
    """Yield the steps of an episode; `unpacked` counts the bytes of pictures of each file."""
    path = folder / names.INFO
    number, length = place["episode_index"], place["length"]
    indexes = {key: place[f"data/{key}"] for key in ("chunk_index", "file_index")}
    data = _inside(folder, _place(info.get("data_path"), path, indexes), path)
    pictures = Pictures(header.image_size)
    frames: Iterator[NDArray[np.uint8]] | None = None
    picture = kept.picture
    if picture is not None and picture.kind == "video":
        key = f"videos/{picture.key}"
        indexes = {name: place[f"{key}/{name}"] for name in indexes}
        video = _place(info.get("video_path"), path, {"video_key": picture.key, **indexes})
        frames = read_video(
            _inside(folder, video, path),
            float(place[f"{key}/from_timestamp"]),
            length,
            header.control_hz,
            cast("tuple[int, int]", header.image_size),
        )
    steps, shown = 0, b""
    most = _MAX_UNPACKED + _MAX_PACKED * data.stat().st_size
    for row in _numbers(data, number, kept):
        where = f"of step {steps} of episode {number} in {data}"
        if steps >= length:
            break
        jpeg: bytes | None = None
        if frames is not None:
            if (pixels := next(frames, None)) is None:
                raise DemosError(f"There is no picture {where}.")
            jpeg = encode_picture(pixels)
        elif picture is not None:
            stored = _stored(row[picture.key], where)
            if stored != shown:  # Else the steps share a picture.
                jpeg, shown = _as_jpeg(stored, pictures, where), stored
                unpacked[data] = unpacked.get(data, 0) + len(stored)
                if unpacked[data] > most:  # One picture can stand in any number of rows.
                    raise DemosError(f"{data} unpacks to more than {most} bytes of pictures.")
        reward = float(row[names.REWARD][0]) if names.REWARD in row else math.nan
        done = names.DONE in row and bool(row[names.DONE][0])
        ended = bool(row[names.TERMINATED][0]) if names.TERMINATED in row else done
        action = row[names.ACTION]
        if not np.isfinite(action).all():
            raise DemosError(f"The action {where} is not finite: remove the episode.")
        step = Step(
            action=tuple(action.tolist()),
            driver=next(drivers),
            state=tuple(value for f in kept.states for value in row[f.key].tolist()),
            reward=None if math.isnan(reward) else reward,
            terminated=ended,
            truncated=done and not ended,
        )
        yield ExchangeStep(step=step, jpeg=jpeg)
        steps += 1
    if steps < length:
        raise DemosError(
            f"{data} has {steps} steps of episode {number}, and {names.EPISODES} says {length}."
        )


def _numbers(path: Path, episode: int, kept: _Kept) -> Iterator[dict[str, Any]]:
    """Yield the features of each step of an episode, in order: vectors, and pictures as stored."""
    index = "episode_index"
    vectors = {f.key: f.size for f in (kept.action, *kept.states)}
    vectors |= dict.fromkeys(kept.columns, 1)
    stored = [kept.picture.key] if kept.picture is not None and kept.picture.kind == "image" else []
    wanted = [index, *vectors, *stored]
    with _parquet(path) as file:
        if missing := [key for key in wanted if key not in file.schema_arrow.names]:
            raise DemosError(f"{path} has no column {missing[0]!r}, which meta/info.json names.")
        for batch in _batches(file, wanted, _groups_of(file, episode)):
            numbers = {
                key: _vectors(batch.column(key), size, f"{path}: {key!r}")
                for key, size in vectors.items()
            }
            pictures = {key: batch.column(key) for key in stored}
            for row, owner in enumerate(batch.column(index).to_pylist()):
                if owner == episode:
                    yield {key: values[row] for key, values in numbers.items()} | {
                        key: column[row].as_py() for key, column in pictures.items()
                    }


def _vectors(column: Any, size: int, what: str) -> NDArray[np.float64]:
    """Return the numbers of a column, shape (n, size)."""
    types = library("pyarrow.types", "lerobot")
    rows = len(column)
    values: Any = getattr(column, "storage", column)  # Of arrays in an extension type.
    even = not types.is_list(values.type) or len(np.unique(values.value_lengths())) == 1
    while types.is_list(values.type) or types.is_fixed_size_list(values.type):
        values = values.flatten()
    if even and len(values) == rows * size:
        try:
            return np.asarray(values.to_numpy(zero_copy_only=False), np.float64).reshape(rows, size)
        except (TypeError, ValueError) as error:
            raise DemosError(f"{what} is not numeric ({error}).") from error
    raise DemosError(f"{what} does not have {size} numbers in each row.")


def _groups_of(file: Any, episode: int) -> list[int]:
    """Return the row groups that may hold steps of an episode, by their statistics."""
    found: list[int] = []
    for number in range(file.metadata.num_row_groups):
        columns = _columns_of(file, [number])
        about = next((c.statistics for c in columns if c.path_in_schema == "episode_index"), None)
        if about is None or not about.has_min_max or about.min <= episode <= about.max:
            found.append(number)
    return found


def _stored(stored: Any, where: str) -> bytes:
    """Return the bytes of a picture of a table."""
    data = cast("dict[str, Any]", stored).get("bytes") if isinstance(stored, dict) else None
    if not isinstance(data, bytes) or not data:
        raise DemosError(f"The picture {where} is not in the table.")
    if len(data) > MAX_PICTURE_BYTES:
        raise DemosError(f"The picture {where} has more than {MAX_PICTURE_BYTES} bytes.")
    return data


def _as_jpeg(data: bytes, pictures: Pictures, where: str) -> bytes:
    """Return a picture as JPEG."""
    if data.startswith(_JPEG):
        pictures.check(data, where)
        return data
    if not data.startswith(_PNG):
        raise DemosError(f"The picture {where} is neither JPEG nor PNG.")
    image = library("PIL.Image", "lerobot")
    try:
        with image.open(io.BytesIO(data), formats=["PNG"]) as opened:
            if pictures.size is not None and opened.size != pictures.size:
                width, height = opened.size
                raise DemosError(
                    f"The picture {where} has {width} x {height} pixels, and not "
                    f"{pictures.size[0]} x {pictures.size[1]} as meta/info.json says."
                )
            pixels = np.asarray(opened.convert("RGB"))
    except (OSError, ValueError, SyntaxError) as error:
        if isinstance(error, DemosError):
            raise
        raise DemosError(f"The picture {where} is damaged ({error}).") from error
    return encode_picture(pixels)
