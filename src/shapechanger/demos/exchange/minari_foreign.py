"""Reads Minari datasets of others, as far as layouts can be made for their spaces.

At most one part of an observation is a picture; all other numbers become the state, in order, and
those of an action the action. Nobody says their units, so each is "?". Pictures that Minari stores
as JPEG stay as they are; others are encoded as JPEG of quality 100, which changes them a little.
Who acted is not said: it is an "expert" here. The rate is that of the key `control_hz`, or 20 Hz.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.episodes import EpisodeHeader, Step
from shapechanger.demos.exchange.hdf5_file import column, open_hdf5
from shapechanger.demos.exchange.minari_spaces import (
    Leaf,
    is_picture,
    layout_of,
    leaves_of,
    stored_as_jpeg,
)
from shapechanger.demos.exchange.pictures import MAX_PIXELS, Pictures, encode
from shapechanger.demos.exchange.recorded import Recorded, Row
from shapechanger.demos.exchange.timing import HZ_UNKNOWN
from shapechanger.errors import DemosError

__all__ = ["read_foreign"]

_CHUNK: Final = 64  # Steps that are in memory at once; pictures may be large.


def read_foreign(
    main: Path,
    observations: spaces.Space[Any],
    actions: spaces.Space[Any],
    count: int,
    *,
    jpeg: bool,
    said: dict[str, Any],
) -> Iterator[Recorded]:
    """The episodes of a dataset.

    Args:
        main: The HDF5 file.
        observations: Space of its observations.
        actions: Space of its actions.
        count: How many episodes there are.
        jpeg: Whether pictures are stored as JPEG where Minari can.
        said: What the metadata say besides: `dataset_id` and `control_hz`, or neither.

    Raises:
        DemosError: If no layout can be made, or something is not whole.
    """
    seen = list(leaves_of(observations))
    pictured = [leaf for leaf in seen if is_picture(leaf.space)]
    if len(pictured) > 1:
        raise DemosError(
            f"An observation in {main} has {len(pictured)} pictures "
            f"({', '.join(leaf.name for leaf in pictured)}), and an episode has one camera: leave "
            "one of them in the dataset."
        )
    numbers = [leaf for leaf in seen if leaf not in pictured]
    acted = list(leaves_of(actions))
    layout = layout_of(acted, "action")
    state = layout_of(numbers, "observation") if numbers else None
    hz = said.get("control_hz")
    known = isinstance(hz, int | float) and math.isfinite(hz) and hz > 0.0
    header = EpisodeHeader(
        action_layout=layout.to_json(),
        state_layout="" if state is None else state.to_json(),
        image_size=_size(pictured[0]) if pictured else None,
        control_hz=float(hz) if isinstance(hz, int | float) and known else HZ_UNKNOWN,
        clock="none",
        source="minari",
        notes={"dataset": str(said.get("dataset_id", "")), "rate_is_known": known},
    )
    as_jpeg = jpeg and bool(pictured) and stored_as_jpeg(pictured[0].space)
    for number in range(count):
        group = f"episode_{number}"
        rows = _rows(main, group, acted, numbers, pictured, as_jpeg=as_jpeg, size=header.image_size)
        yield Recorded(header=header, rows=rows, name=f"{main}, {group}")


def _rows(
    main: Path,
    group: str,
    acted: Sequence[Leaf],
    numbers: Sequence[Leaf],
    pictured: Sequence[Leaf],
    *,
    as_jpeg: bool,
    size: tuple[int, int] | None,
) -> Iterator[Row]:
    pictures = Pictures(size)
    with open_hdf5(main) as file:
        rewards = column(file, f"{group}/rewards", main)
        steps = int(rewards.shape[0])

        def columns(leaves: Sequence[Leaf], of: str) -> list[Any]:
            return [column(file, "/".join((group, of, *leaf.path)), main, steps) for leaf in leaves]

        action, state = columns(acted, "actions"), columns(numbers, "observations")
        frames = columns(pictured, "observations")
        ends = [column(file, f"{group}/{n}", main, steps) for n in ("terminations", "truncations")]
        for start in range(0, steps, _CHUNK):
            part = slice(start, min(start + _CHUNK, steps))
            actions, states = _flat(action, acted, part, main), _flat(state, numbers, part, main)
            worth, over, cut = rewards[part], ends[0][part], ends[1][part]
            seen = frames[0][part] if frames else None
            for place in range(part.stop - start):
                where = f"of step {start + place} of {group} in {main}"
                reward = float(worth[place])
                if not np.isfinite(actions[place]).all():
                    raise DemosError(f"The action {where} is not finite: take the episode out.")
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
                yield Row(step=step, jpeg=jpeg)


def _flat(
    columns: Sequence[Any], leaves: Sequence[Leaf], part: slice, main: Path
) -> NDArray[np.float64]:
    """The numbers of some steps, shape (n, size of all leaves)."""
    steps = part.stop - part.start
    flat = [np.empty((steps, 0))]
    for values, leaf in zip(columns, leaves, strict=True):
        try:
            numbers = np.asarray(values[part], np.float64).reshape(steps, -1)
        except (ValueError, TypeError) as error:
            raise DemosError(f"{main}: {values.name!r} holds no numbers ({error}).") from error
        size = max(1, math.prod(leaf.space.shape or ()))
        if numbers.shape[1] != size:
            raise DemosError(
                f"{main}: {values.name!r} has {numbers.shape[1]} numbers a step, and its space "
                f"has {size}."
            )
        flat.append(numbers)
    return np.concatenate(flat, axis=1)


def _encoded(pixels: NDArray[Any], size: tuple[int, int] | None, where: str) -> bytes:
    """A picture as JPEG."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    elif pixels.ndim == 3 and _colours_first(pixels.shape):
        pixels = np.moveaxis(pixels, 0, -1)
    if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[1::-1] != size:
        raise DemosError(f"The picture {where} is not as its space says: create the dataset anew.")
    return encode(np.repeat(pixels, 3, -1) if pixels.shape[-1] == 1 else pixels)


def _colours_first(shape: tuple[int, ...]) -> bool:
    return shape[0] in {1, 3} and shape[2] not in {1, 3}


def _size(leaf: Leaf) -> tuple[int, int]:
    """Width and height of the pictures of a space, in pixels.

    Raises:
        DemosError: If they are larger than pictures can be.
    """
    shape = leaf.space.shape or (0, 0)
    first = 1 if len(shape) == 3 and _colours_first(shape) else 0
    height, width = shape[first], shape[first + 1]
    if height * width > MAX_PIXELS:
        raise DemosError(
            f"The pictures of {leaf.name or 'the observation'} have {width} x {height} pixels, and "
            f"at most {MAX_PIXELS} are read: make them smaller."
        )
    return width, height
