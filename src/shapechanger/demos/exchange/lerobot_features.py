"""Features of a LeRobot dataset: which are imported, and what they are called."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any, Final, cast

from shapechanger.demos.exchange import lerobot_export as names
from shapechanger.demos.exchange.format import ImportContext
from shapechanger.demos.jpeg import MAX_PIXELS
from shapechanger.errors import DemosError, UnknownName
from shapechanger.layout import Feature, Layout

_OBSERVATION: Final = "observation."
_CAMERAS: Final = "observation.images."
_PICTURES: Final = ("video", "image")
_NUMBERS: Final = re.compile(r"bool|u?int(8|16|32|64)|float(16|32|64)")
_BOOKKEEPING: Final = ("timestamp", "frame_index", "episode_index", "index", "task_index")
_DEPTH: Final = ("video.is_depth_map", "is_depth_map")
_CHANNELS: Final = (1, 3, 4)
_AXES: Final = ["c", "h", "w"]
_UNIT_UNKNOWN: Final = "?"
_MAX_FEATURES: Final = 512  # A larger vector becomes one array feature.
_MAX_VALUES: Final = 1 << 17


@dataclass(frozen=True, slots=True)
class DatasetFeature:
    """A feature of `info.json`.

    Attributes:
        key: Its key, such as "observation.state".
        kind: Its dtype.
        shape: Its shape.
        names: Names of its values, or of its axes; () if there are none.
        units: Units of its values; () if there are none.
        is_depth: Whether it is stated to be of a depth camera.
    """

    key: str
    kind: str
    shape: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    is_depth: bool

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)

    @property
    def is_number(self) -> bool:
        """Whether its values are numbers, and not those of an image."""
        image = len(self.shape) == 3 or self.key.startswith(_CAMERAS)
        return not image and bool(_NUMBERS.fullmatch(self.kind)) and self.size <= _MAX_VALUES

    @property
    def is_picture(self) -> bool:
        """Whether it is a camera's whose pictures can be imported."""
        return self.kind in _PICTURES and not self.is_depth

    def picture_size(self, path: Path) -> tuple[int, int]:
        """Return the width and height of its pictures, pixels.

        Axes are found by their names if those fit, or else by the number of colours. The pictures
        themselves are compared with it.

        Raises:
            DemosError: If the shape is not that of a picture.
        """
        shape = self.shape if len(self.shape) == 3 else (*self.shape, 1)
        axes = [name[:1].lower() for name in self.names]
        if sorted(axes) == _AXES and len(shape) == 3 and shape[axes.index("c")] in _CHANNELS:
            channels, height, width = (shape[axes.index(axis)] for axis in _AXES)
        elif len(shape) == 3 and shape[2] in _CHANNELS:
            height, width, channels = shape
        else:
            channels, height, width = shape if len(shape) == 3 else (0, 0, 0)
        if channels not in _CHANNELS or height * width > MAX_PIXELS:
            raise DemosError(
                f"{path}: {self.key} has the shape {list(self.shape)}, not of a picture."
            )
        return width, height


@dataclass(frozen=True, slots=True)
class ImportedFeatures:
    """The features that are imported."""

    action: DatasetFeature
    states: tuple[DatasetFeature, ...]
    picture: DatasetFeature | None
    columns: frozenset[str]

    @classmethod
    def of(
        cls, features: Sequence[DatasetFeature], context: ImportContext, path: Path
    ) -> ImportedFeatures:
        """Choose features, and report the others.

        Args:
            features: All features.
            context: Its `camera` is the name of the camera, such as "front"; "" for the only one.
            path: The file that they stand in, for errors.
        """
        numbers = {feature.key: feature for feature in features if feature.is_number}
        if names.ACTION not in numbers:
            raise DemosError(f"{path} has no numeric feature {names.ACTION!r}: there is no action.")
        states = [f for key, f in numbers.items() if key.startswith(_OBSERVATION)]
        states.sort(key=lambda feature: feature.key != names.STATE)  # Stable: the state first.
        more = {names.REWARD, names.DONE, names.TERMINATED}
        columns = frozenset(key for key in more if key in numbers and numbers[key].size == 1)
        picture = _chosen([f for f in features if f.is_picture], context.camera, path)
        taken = {names.ACTION, *(f.key for f in states), *columns, *_BOOKKEEPING}
        for feature in features:
            about = f"{feature.key} ({feature.kind}, {' x '.join(map(str, feature.shape))})"
            if feature.key in taken or feature is picture:
                continue
            if feature.is_number or feature.is_picture or not _looks_like_image(feature):
                context.note(f"The feature {about} is not imported.")
            else:
                context.leave_out("feature", "with pictures of an unknown kind or of depth", about)
        return cls(numbers[names.ACTION], tuple(states), picture, columns)


def _looks_like_image(feature: DatasetFeature) -> bool:
    """Return whether a feature that is neither numbers nor pictures is an image."""
    return feature.is_depth or len(feature.shape) > 1 or feature.key.startswith(_CAMERAS)


def _chosen(cameras: Sequence[DatasetFeature], camera: str, path: Path) -> DatasetFeature | None:
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


def read_features(info: dict[str, Any], path: Path) -> list[DatasetFeature]:
    """Return the features of `info.json`.

    Raises:
        DemosError: If there are none, or one has no dtype and shape.
    """
    plain = info.get("features")
    found: list[DatasetFeature] = []
    if not isinstance(plain, dict):
        raise DemosError(f"{path} has no features.")
    for key, feature in cast("dict[str, Any]", plain).items():
        try:
            shape = tuple(int(n) for n in feature["shape"])
            kind = str(feature["dtype"])
            named = _flat_names(feature.get("names"))
            units = feature.get("units")
            about = cast("dict[str, Any]", feature.get("info") or {})
            is_depth = any(
                bool(part.get(flag))
                for part in (cast("dict[str, Any]", feature), about)
                for flag in _DEPTH
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise DemosError(f"{path}: the feature {key!r} has no dtype and shape.") from error
        if any(n < 1 for n in shape) or (
            key in {names.ACTION, names.STATE} and math.prod(shape) > _MAX_VALUES
        ):
            raise DemosError(f"{path}: the feature {key!r} has the shape {list(shape)}.")
        stated = tuple(map(str, cast("list[Any]", units))) if isinstance(units, list) else ()
        found.append(DatasetFeature(key, kind, shape, named, stated, is_depth))
    return found


def _flat_names(plain: Any) -> tuple[str, ...]:
    """Return names that are a list, lists in a dictionary, or a dictionary of their positions.

    All three are used: `["pan", "tilt"]`, `{"motors": ["pan", "tilt"]}`, `{"pan": 0, "tilt": 1}`.
    """
    if isinstance(plain, dict):
        named = cast("dict[str, Any]", plain)
        if sorted(map(repr, named.values())) == sorted(map(repr, range(len(named)))):
            return tuple(sorted(named, key=lambda name: named[name]))
        return tuple(chain.from_iterable(map(_flat_names, named.values())))
    if isinstance(plain, list):
        return tuple(map(str, cast("list[Any]", plain)))
    return ()


def layout_of(features: Sequence[DatasetFeature], context: ImportContext) -> Layout:
    """Return a layout for the values of features, in order, with their names and units."""
    found: list[Feature] = []
    for feature in features:
        key = feature.key.removeprefix(_OBSERVATION)
        prefix = "" if feature.key in {names.ACTION, names.STATE} else f"{key}/"
        named = tuple(prefix + name for name in feature.names)
        units = feature.units
        if len(units) != feature.size or not all(units):
            units = (_UNIT_UNKNOWN,) * feature.size
        if len(set(named)) != feature.size or not all(feature.names):
            if named:
                context.note(
                    f"The {len(set(named))} names of {feature.key} do not fit its {feature.size} "
                    "values, which are numbered."
                )
            if feature.size > _MAX_FEATURES:
                unit = units[0] if len(set(units)) == 1 else _UNIT_UNKNOWN
                found.append(Feature(key, unit, shape=(feature.size,)))
                continue
            many = feature.size > 1
            named = tuple(f"{key}/{n}" for n in range(feature.size)) if many else (key,)
        found += [Feature(name, unit) for name, unit in zip(named, units, strict=True)]
    if len({feature.name for feature in found}) < len(found):
        context.note("Names of several features are the same: their values are numbered.")
        found = [Feature(f"value/{n}", _UNIT_UNKNOWN) for n in range(sum(f.size for f in found))]
    return Layout(tuple(found))
