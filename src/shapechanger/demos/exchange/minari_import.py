"""Import of Minari datasets: exact for our own, and as far as possible for those of others.

Of a foreign dataset, at most one part of an observation may be a picture; all other values become
the state, in order, and those of an action the action. Units are unknown and written "?". Pictures
that Minari stores as JPEG are kept; others are encoded as JPEG of quality 100, which changes them
slightly. The driver is unknown and taken to be an "expert". The rate is that of the key
`control_hz`, that of `--hz`, or 20 Hz.

Neither Minari's own folder nor the network is used, and no external HDF5 link is followed.
"""

from __future__ import annotations

import json
import math
from collections.abc import Generator, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import DRIVERS, EpisodeHeader, Step
from shapechanger.demos.exchange import minari_export as names
from shapechanger.demos.exchange.files import (
    Pictures,
    library,
    parse_json,
    parse_json_object,
    read_text,
    resolve_file,
)
from shapechanger.demos.exchange.importing import ImportContext
from shapechanger.demos.exchange.minari_export import stored_as_jpeg
from shapechanger.demos.exchange.recorded import DEFAULT_HZ, ExchangeEpisode, ExchangeStep
from shapechanger.demos.jpeg import MAX_PIXELS, encode_picture
from shapechanger.errors import DemosError, MissingExtra, UnknownName
from shapechanger.layout import Feature, Layout

_OWN_CHUNK: Final = 256  # Steps in memory at once.
_FOREIGN_CHUNK: Final = 64  # Fewer, because pictures may be stored as pixels.
_OWN_COLUMNS: Final = (
    "actions",
    "rewards",
    "terminations",
    "truncations",
    "infos/rewarded",
    "infos/applied",
    "infos/has_applied",
    "infos/wanted",
    "infos/has_wanted",
    *(f"infos/{name}" for name in names.TIMES),
    "infos/driver",
    "infos/stop_reason",
    "infos/more",
)
_MAX_UNPACKED: Final = 64 << 20  # Bytes. A picture of `MAX_PIXELS` has 48 MiB.
_UNIT_UNKNOWN: Final = "?"
_MAX_FEATURES: Final = 512  # A larger space becomes one array feature.
_MIN_PICTURE: Final = 8  # Pixels. A smaller grid is a map, not a picture.
_CHANNELS: Final = (1, 3)


def read_minari(folder: Path, context: ImportContext) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset.

    Args:
        folder: Folder of the dataset.
        context: Its `hz` applies where the metadata has no `control_hz`.

    Raises:
        DemosError: If something is damaged or missing, or a space cannot be imported.
        MissingExtra: If Minari or h5py is not installed.
    """
    place = names.data_folder(folder)
    if place is None:
        raise DemosError(f"There is no Minari dataset in {folder}: it needs {names.METADATA}.")
    path = place / names.METADATA
    metadata = parse_json_object(read_text(path), str(path))
    if metadata.get("data_format", "hdf5") != "hdf5":
        raise DemosError(
            f"{folder} is stored as {metadata['data_format']!r}, but only 'hdf5' is supported: "
            "create it with data_format='hdf5'."
        )
    main = resolve_file(place, names.MAIN, str(path))
    count = metadata.get("total_episodes")
    if not isinstance(count, int) or isinstance(count, bool) or count < 1:
        raise DemosError(f"{path}: total_episodes must be a positive integer, got {count!r}.")
    _require_stored(main, count)
    if names.HEADERS in metadata:
        yield from _read_own(main, path, metadata[names.HEADERS], count)
    else:
        yield from _read_foreign(main, path, metadata, count, context)


def _require_stored(main: Path, count: int) -> None:
    """Refuse a file that claims more steps than it has bytes.

    HDF5 stores empty arrays of any size in no bytes, and one array under any number of names.

    Args:
        main: The HDF5 file.
        count: Number of episodes.
    """
    size = main.stat().st_size
    claimed = 0
    with _open_hdf5(main) as file:
        for number in range(count):
            claimed += int(_column(file, f"episode_{number}/rewards", main, 0).shape[0])
            if claimed > size:
                raise DemosError(f"{main} claims at least {claimed} steps, but has {size} bytes.")


def _read_own(main: Path, path: Path, section: object, count: int) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset exported by Shapechanger.

    Args:
        main: The HDF5 file.
        path: The metadata file, for errors.
        section: Shapechanger's section of the metadata.
        count: Number of episodes.
    """
    fields = cast("dict[str, Any]", section) if isinstance(section, dict) else {}
    headers = fields.get("episodes")
    if fields.get("format") != names.HEADERS_FORMAT or not isinstance(headers, list):
        raise DemosError(
            f"{path} was written by another version of Shapechanger: this one reads format "
            f"{names.HEADERS_FORMAT} only."
        )
    plain = cast("list[dict[str, Any]]", headers)
    if len(plain) != count:
        raise DemosError(
            f"{path} has the headers of {len(plain)} episodes, but total_episodes is {count}."
        )
    for number, header in enumerate(plain):
        where = f"{path}, episode {number}"
        try:
            known = EpisodeHeader.from_json(header)
        except DemosError as error:
            raise DemosError(f"{where}: {error}") from error
        yield ExchangeEpisode(
            header=known,
            rows=_own_rows(main, f"episode_{number}", known),
            name=where,
            outcome=str(header.get("outcome", "")),
        )


def _own_rows(main: Path, group: str, header: EpisodeHeader) -> Iterator[ExchangeStep]:
    pictures = Pictures(header.image_size)
    frame = -1
    with _open_hdf5(main) as file:
        steps = int(_column(file, f"{group}/rewards", main).shape[0])
        places = {name: name for name in _OWN_COLUMNS} | _observed(file, group, header)
        columns = {
            name: _column(file, f"{group}/{place}", main, steps) for name, place in places.items()
        }
        cut_off = bool(_column(file, f"{group}/infos/cut_off", main, 1)[0])
        count = _chunk(columns.values(), _OWN_CHUNK)
        for start in range(0, steps, count):
            chunk = {name: values[start : start + count] for name, values in columns.items()}
            for place in range(min(count, steps - start)):
                at = {name: values[place] for name, values in chunk.items()}
                where = f"{main}, step {start + place} of {group}"
                row = _own_step(at, where)
                if cut_off and start + place == steps - 1:
                    row = replace(row, step=replace(row.step, truncated=False))
                if "infos/frame" in at and int(at["infos/frame"]) != frame:
                    frame = int(at["infos/frame"])
                    row = replace(row, jpeg=bytes(at[names.JPEG]))
                    pictures.check(bytes(at[names.JPEG]), f"of {where}")
                yield row


def _observed(file: Any, group: str, header: EpisodeHeader) -> dict[str, str]:
    """Return the places of the picture and the state in the file."""
    pictured = f"{group}/infos/frame" in file
    has_state = bool(header.state_layout)
    places: dict[str, str] = {}
    if has_state:
        places[names.STATE] = f"observations/{names.STATE}" if pictured else "observations"
    if pictured:
        beside = f"infos/{names.JPEG}"
        inside = f"observations/{names.IMAGE}" if has_state else "observations"
        places[names.JPEG] = beside if f"{group}/{beside}" in file else inside
        places["infos/frame"] = "infos/frame"
    return places


def _own_step(at: dict[str, Any], where: str) -> ExchangeStep:
    """Return a step, without its picture."""
    try:
        more = json.loads(at["infos/more"])
        driver = at["infos/driver"].decode()
        known = {name: int(at[f"infos/{name}"]) for name in names.TIMES}
        times_ns: dict[str, Any] = {n: ns for n, ns in known.items() if ns != names.UNKNOWN_NS}
        step = Step(
            action=_vector(at["actions"]),
            driver=driver,
            applied=_vector(at["infos/applied"]) if at["infos/has_applied"] else None,
            wanted=_vector(at["infos/wanted"]) if at["infos/has_wanted"] else None,
            state=_vector(at[names.STATE]) if names.STATE in at else (),
            **times_ns,
            reward=float(at["rewards"]) if at["infos/rewarded"] else None,
            terms={name: float(value) for name, value in more.get("terms", {}).items()},
            terminated=bool(at["terminations"]),
            truncated=bool(at["truncations"]),
            stop_reason=str(more.get("stop_reason", at["infos/stop_reason"].decode())),
        )
        marks = tuple(str(mark) for mark in more.get("marks", ()))
        dropped = more.get("dropped")
    except (ValueError, TypeError, AttributeError, LookupError) as error:
        raise DemosError(f"{where} cannot be read: {error}.") from error
    if driver not in DRIVERS:
        raise DemosError(f"{where}: {UnknownName('driver', driver, DRIVERS)}")
    return ExchangeStep(
        step=step, jpeg=None, marks=marks, dropped=None if dropped is None else str(dropped)
    )


def _vector(values: Any) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


@dataclass(frozen=True, slots=True)
class _Leaf:
    """A space without subspaces, in a tree of spaces.

    Attributes:
        path: Keys that lead to it, as in the file; () for the tree itself.
        space: The space.
    """

    path: tuple[str, ...]
    space: spaces.Space[Any]

    @property
    def name(self) -> str:
        """The path as one word; "" for the tree itself."""
        return "/".join(self.path)


def _read_foreign(
    main: Path, path: Path, metadata: dict[str, Any], count: int, context: ImportContext
) -> Iterator[ExchangeEpisode]:
    """Yield the episodes of a dataset of others.

    Args:
        main: The HDF5 file.
        path: The metadata file, for errors.
        metadata: Its content.
        count: Number of episodes.
        context: Options and findings of the import.
    """
    observed = list(_leaves_of(_space(metadata, "observation_space", path)))
    acted = list(_leaves_of(_space(metadata, "action_space", path)))
    pictured = [leaf for leaf in observed if _picture_size(leaf.space)]
    if len(pictured) > 1:
        raise DemosError(
            f"An observation in {main} has {len(pictured)} pictures "
            f"({', '.join(leaf.name for leaf in pictured)}), but an episode has one camera: keep "
            "one of them in the dataset."
        )
    sensed = [leaf for leaf in observed if leaf not in pictured]
    hz = metadata.get("control_hz", context.hz)
    known = isinstance(hz, int | float) and math.isfinite(hz) and hz > 0.0
    if not known:
        context.note(f"The rate is unknown and taken to be {DEFAULT_HZ:g} Hz; --hz states it.")
    header = EpisodeHeader(
        action_layout=_layout_of(acted, "action").to_json(),
        state_layout=_layout_of(sensed, "observation").to_json() if sensed else "",
        image_size=_picture_size(pictured[0].space) if pictured else None,
        control_hz=float(hz) if isinstance(hz, int | float) and known else DEFAULT_HZ,
        clock="none",
        source="minari",
        notes={"dataset": str(metadata.get("dataset_id", "")), "rate_is_known": known},
    )
    jpeg = bool(metadata.get("jpeg_encoding", True))
    as_jpeg = jpeg and bool(pictured) and stored_as_jpeg(pictured[0].space)
    for number in range(count):
        group = f"episode_{number}"
        yield ExchangeEpisode(
            header=header,
            rows=_foreign_rows(
                main, group, acted, sensed, pictured, as_jpeg=as_jpeg, size=header.image_size
            ),
            name=f"{main}, {group}",
        )


def _space(metadata: dict[str, Any], name: str, path: Path) -> spaces.Space[Any]:
    text = metadata.get(name)
    if not isinstance(text, str):
        raise DemosError(
            f"{path} has no {name}, so its values cannot be interpreted: create the dataset again "
            "with this space."
        )
    if _largest(parse_json(text, f"The {name} in {path}")) > _MAX_UNPACKED:
        raise DemosError(f"The {name} in {path} claims more than {_MAX_UNPACKED} values.")
    try:
        return library("minari.serialization").deserialize_space(text)
    except MissingExtra:
        raise
    except Exception as error:  # Its errors for invalid text are not documented.
        raise DemosError(f"The {name} in {path} cannot be read: {error}.") from error


def _largest(space: Any) -> int:
    """Return the number of values that the shapes in the JSON of a space claim."""
    if isinstance(space, list):
        return sum(map(_largest, cast("list[Any]", space)))
    if not isinstance(space, dict):
        return 0
    fields = cast("dict[str, Any]", space)
    shape = cast("list[Any]", s) if isinstance(s := fields.get("shape"), list) else []
    own = math.prod(n for n in shape if isinstance(n, int))
    return own + sum(_largest(value) for key, value in fields.items() if key != "shape")


def _leaves_of(space: spaces.Space[Any], path: tuple[str, ...] = ()) -> Iterator[_Leaf]:
    """Yield the leaves of a tree of spaces, in the order and with the keys of Minari's files."""
    if isinstance(space, spaces.Dict):
        parts = cast("dict[str, spaces.Space[Any]]", cast("Any", space).spaces)
        for key, inner in parts.items():
            yield from _leaves_of(inner, (*path, key))
    elif isinstance(space, spaces.Tuple):
        for number, inner in enumerate(
            cast("tuple[spaces.Space[Any], ...]", cast("Any", space).spaces)
        ):
            yield from _leaves_of(inner, (*path, f"_index_{number}"))
    else:
        yield _Leaf(path, space)


def _layout_of(leaves: list[_Leaf], what: str) -> Layout:
    """Return a layout for the values of some leaves, in order.

    Args:
        leaves: The leaves.
        what: What they belong to, "action" or "observation".
    """
    features: list[Feature] = []
    for leaf in leaves:
        low, high = _bounds(leaf, what)
        name = leaf.name or what
        if low.size == 1:
            features.append(Feature(name, _UNIT_UNKNOWN, float(low[0]), float(high[0])))
        elif low.size > _MAX_FEATURES:
            block = (int(low.size),)
            features.append(
                Feature(name, _UNIT_UNKNOWN, float(low.min()), float(high.max()), shape=block)
            )
        else:
            features += [
                Feature(f"{name}/{number}", _UNIT_UNKNOWN, float(lowest), float(highest))
                for number, (lowest, highest) in enumerate(zip(low, high, strict=True))
            ]
    return Layout(tuple(features))


def _bounds(leaf: _Leaf, what: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the bounds of the values of a leaf, shape (n,) each."""
    space = leaf.space
    match space:
        case spaces.Box():
            low, high = space.low.ravel(), space.high.ravel()
        case spaces.Discrete():
            low, high = np.array([space.start]), np.array([space.start + space.n - 1])
        case spaces.MultiDiscrete():
            low, high = space.start.ravel(), (space.start + space.nvec - 1).ravel()
        case spaces.MultiBinary():
            low = np.zeros(space.shape).ravel()
            high = np.ones(space.shape).ravel()
        case _:
            raise DemosError(
                f"The {what} has {leaf.name or 'a space'!r} of the type {type(space).__name__}, "
                "which cannot be imported: use Box, Discrete, MultiDiscrete or MultiBinary."
            )
    if low.size == 0:
        raise DemosError(f"The {what} has {leaf.name or 'a space'!r} without any values.")
    return low.astype(np.float64), high.astype(np.float64)


def _picture_size(space: spaces.Space[Any]) -> tuple[int, int] | None:
    """Return the width and height of the pictures of a space; None if it has no pictures."""
    shape = space.shape or ()
    if not isinstance(space, spaces.Box) or cast("Any", space).dtype != np.uint8:
        return None
    if len(shape) == 3 and _colours_first(shape):
        shape = shape[1:]
    elif len(shape) != 2 and (len(shape) != 3 or shape[2] not in _CHANNELS):
        return None
    height, width = shape[:2]
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The pictures of the dataset have {width} x {height} pixels, more than the limit of "
            f"{MAX_PIXELS}: make them smaller."
        )
    return (width, height) if min(height, width) >= _MIN_PICTURE else None


def _colours_first(shape: tuple[int, ...]) -> bool:
    return shape[0] in _CHANNELS and shape[2] not in _CHANNELS


def _foreign_rows(
    main: Path,
    group: str,
    acted: Sequence[_Leaf],
    sensed: Sequence[_Leaf],
    pictured: Sequence[_Leaf],
    *,
    as_jpeg: bool,
    size: tuple[int, int] | None,
) -> Iterator[ExchangeStep]:
    pictures = Pictures(size)
    with _open_hdf5(main) as file:
        rewards = _column(file, f"{group}/rewards", main)
        steps = int(rewards.shape[0])

        def columns(leaves: Sequence[_Leaf], of: str) -> list[Any]:
            return [
                _column(file, "/".join((group, of, *leaf.path)), main, steps) for leaf in leaves
            ]

        action, state = columns(acted, "actions"), columns(sensed, "observations")
        frames = columns(pictured, "observations")
        ends = [_column(file, f"{group}/{n}", main, steps) for n in ("terminations", "truncations")]
        count = _chunk((*action, *state, *frames, *ends), _FOREIGN_CHUNK)
        for start in range(0, steps, count):
            part = slice(start, min(start + count, steps))
            actions, states = _flat(action, acted, part, main), _flat(state, sensed, part, main)
            worth, over, cut = rewards[part], ends[0][part], ends[1][part]
            seen = frames[0][part] if frames else None
            for place in range(part.stop - start):
                where = f"of step {start + place} of {group} in {main}"
                reward = float(worth[place])
                if not np.isfinite(actions[place]).all():
                    raise DemosError(f"The action {where} is not finite: remove the episode.")
                step = Step(
                    action=tuple(actions[place].tolist()),
                    driver="expert",
                    state=tuple(states[place].tolist()),
                    reward=None if math.isnan(reward) else reward,
                    terminated=bool(over[place]),
                    truncated=bool(cut[place]),
                )
                jpeg = None
                if seen is not None and as_jpeg:
                    jpeg = bytes(seen[place])
                    pictures.check(jpeg, where)
                elif seen is not None:
                    jpeg = _encoded(np.asarray(seen[place]), size, where)
                yield ExchangeStep(step=step, jpeg=jpeg)


def _flat(
    columns: Sequence[Any], leaves: Sequence[_Leaf], part: slice, main: Path
) -> NDArray[np.float64]:
    """Return the values of some steps, shape (n, size of all leaves)."""
    steps = part.stop - part.start
    flat = [np.empty((steps, 0))]
    for values, leaf in zip(columns, leaves, strict=True):
        try:
            numbers = np.asarray(values[part], np.float64).reshape(steps, -1)
        except (ValueError, TypeError) as error:
            raise DemosError(f"{main}: {values.name!r} is not numeric ({error}).") from error
        size = max(1, math.prod(leaf.space.shape or ()))
        if numbers.shape[1] != size:
            raise DemosError(
                f"{main}: {values.name!r} has {numbers.shape[1]} values per step, but its space "
                f"has {size}."
            )
        flat.append(numbers)
    return np.concatenate(flat, axis=1)


def _encoded(pixels: NDArray[Any], size: tuple[int, int] | None, where: str) -> bytes:
    """Return a picture as JPEG."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and _colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        raise DemosError(f"The picture {where} does not fit its space: create the dataset again.")
    return encode_picture(np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels)


@contextmanager
def _open_hdf5(path: Path) -> Generator[Any]:
    """Open an HDF5 file for reading, as an `h5py.File`."""
    h5py = library("h5py")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise DemosError(f"{path} is not an intact HDF5 file: {error}.") from error
    try:
        yield file
    except (OSError, RuntimeError) as error:  # Raised by h5py for inconsistent bytes.
        raise DemosError(f"{path} is damaged: {error}.") from error
    finally:
        file.close()


def _row_bytes(column: Any) -> int:
    """Return the memory of one entry of a dataset, bytes."""
    return math.prod(column.shape[1:]) * column.dtype.itemsize


def _chunk(columns: Iterable[Any], most: int) -> int:
    """Return how many steps to read at once, so that they fit into `_MAX_UNPACKED` or are one.

    Args:
        columns: The datasets to read from.
        most: Largest number of steps.
    """
    return max(1, min(most, _MAX_UNPACKED // max(1, sum(map(_row_bytes, columns)))))


def _column(file: Any, name: str, where: Path, length: int | None = None) -> Any:
    """Return a dataset in an HDF5 file.

    Args:
        file: An open `h5py.File`.
        name: Path of the dataset in the file.
        where: Path of the file, for errors.
        length: Minimum number of entries; None for any number.
    """
    h5py = library("h5py")
    found: Any = file
    for part in name.split("/"):
        link = found.get(part, getlink=True) if isinstance(found, h5py.Group) else None
        if isinstance(link, h5py.ExternalLink):
            raise DemosError(f"{where} has {name!r} in another file, which is not opened.")
        if isinstance(link, h5py.SoftLink):  # It may lead through a link to another file.
            raise DemosError(f"{where} has a link for {name!r}, and links are not followed.")
        if link is None or (found := found.get(part)) is None:
            raise DemosError(f"{where} has no {name!r}, so the dataset is incomplete.")
    if not isinstance(found, h5py.Dataset):
        raise DemosError(f"{where}: {name!r} is not an array.")
    if found.external or found.is_virtual:
        raise DemosError(f"{where} has {name!r} in another file, which is not opened.")
    # HDF5 unpacks whole chunks, and a step may claim any shape.
    unpacked = max(_row_bytes(found), math.prod(found.chunks or ()) * found.dtype.itemsize)
    if unpacked > _MAX_UNPACKED:
        raise DemosError(
            f"{where}: {name!r} unpacks to {unpacked} bytes at once, more than the limit of "
            f"{_MAX_UNPACKED}."
        )
    if length is not None and (not found.shape or found.shape[0] < length):
        have = found.shape[0] if found.shape else 0
        raise DemosError(f"{where}: {name!r} has {have} entries, but {length} are needed.")
    return found
