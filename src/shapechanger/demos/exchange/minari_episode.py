"""Writes the steps of one episode into a Minari dataset: see `minari_files`."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, cast

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from shapechanger.demos.exchange import minari_files as files
from shapechanger.demos.exchange.hdf5_columns import GrowingColumns
from shapechanger.demos.exchange.minari_spaces import box_of, grid_of, stored_as_jpeg
from shapechanger.demos.exchange.pictures import Pictures, decode, is_grey
from shapechanger.demos.exchange.recorded import Row
from shapechanger.errors import DemosError
from shapechanger.layout import Layout

__all__ = ["EpisodeColumns", "Observed"]

_OBSERVATIONS: Final = "observations"


@dataclass(frozen=True, kw_only=True)
class Observed:
    """What a step sees.

    Attributes:
        state: What its numbers mean; None without a state.
        size: Width and height of its picture in pixels; None without pictures.
        grey: Whether pictures have no colours.
    """

    state: Layout | None = None
    size: tuple[int, int] | None = None
    grey: bool = False

    @property
    def picture(self) -> spaces.Box | None:
        """The space of the pictures."""
        return None if self.size is None else grid_of(*self.size, grey=self.grey)

    @property
    def as_jpeg(self) -> bool:
        """Whether Minari stores the pictures as JPEG."""
        picture = self.picture
        return picture is not None and stored_as_jpeg(picture)

    @property
    def space(self) -> spaces.Space[Any]:
        """The space of an observation."""
        picture = self.picture
        state = None if self.state is None else box_of(self.state)
        if picture is not None and state is not None:
            return spaces.Dict({files.IMAGE: picture, files.STATE: state})
        return cast("spaces.Space[Any]", picture if state is None else state)

    def column(self, part: str) -> str:
        """The place of a part of the observations in the file."""
        both = self.size is not None and self.state is not None
        return f"{_OBSERVATIONS}/{part}" if both else _OBSERVATIONS


class EpisodeColumns:
    """The columns of one episode.

    Attributes:
        steps: How many steps were written.
    """

    def __init__(self, group: Any, name: str, observed: Observed, actions: int) -> None:
        self.steps = 0
        self._group = group
        self._columns = GrowingColumns(group)
        self._name = name
        self._observed = observed
        self._as_jpeg = observed.as_jpeg
        self._actions = actions
        self._pictures = Pictures(observed.size)
        self._picture: bytes | None = None
        self._pixels: NDArray[np.uint8] | None = None
        self._frame = -1
        self._ends = True

    def add(self, rows: Sequence[Row]) -> None:
        """Append steps.

        Raises:
            DemosError: If one has no picture, or one that does not fit.
        """
        if self._observed.size is not None:
            self._add_pictures(rows)
        if self._observed.state is not None:
            states = np.array([row.step.state for row in rows], np.float64)
            self._columns.numbers(self._observed.column(files.STATE), states)
        steps = [row.step for row in rows]
        numbers, texts = self._columns.numbers, self._columns.texts
        numbers("actions", np.array([step.action for step in steps], np.float64))
        rewards = [math.nan if step.reward is None else step.reward for step in steps]
        numbers("rewards", np.array(rewards, np.float64))
        numbers("terminations", np.array([step.terminated for step in steps]))
        numbers("truncations", np.array([step.truncated for step in steps]))
        numbers("infos/rewarded", np.array([step.reward is not None for step in steps]))
        nothing = (math.nan,) * self._actions
        for name, values in (
            ("applied", [step.applied for step in steps]),
            ("wanted", [step.wanted for step in steps]),
        ):
            known = [nothing if value is None else value for value in values]
            numbers(f"infos/{name}", np.array(known, np.float64))
            numbers(f"infos/has_{name}", np.array([value is not None for value in values]))
        for name in files.TIMES:
            times = [getattr(step, name) for step in steps]
            unknown = [files.UNKNOWN_NS if time is None else time for time in times]
            numbers(f"infos/{name}", np.array(unknown, np.int64))
        texts("infos/driver", [step.driver for step in steps])
        texts("infos/stop_reason", [step.stop_reason for step in steps])
        texts("infos/more", [_more(row) for row in rows])
        self._ends = steps[-1].terminated or steps[-1].truncated
        self.steps += len(rows)

    def close(self) -> int:
        """Give the episode its last observation and its end; how many steps there are.

        Where nobody said that the episode ends, its last step is truncated: a learner must not
        take the next episode for what follows.
        """
        if self._observed.size is not None:
            self._columns.repeat_last(self._observed.column(files.IMAGE))
        if self._observed.state is not None:
            self._columns.repeat_last(self._observed.column(files.STATE))
        self._columns.numbers("infos/cut_off", np.array([not self._ends]))
        if not self._ends:
            self._group["truncations"][-1] = True
        return self.steps

    def _add_pictures(self, rows: Sequence[Row]) -> None:
        jpegs: list[bytes] = []
        pixels: list[NDArray[np.uint8]] = []
        frames: list[int] = []
        for number, row in enumerate(rows, self.steps):
            where = f"of step {number} of {self._name}"
            if row.jpeg is not None:
                self._pictures.check(row.jpeg, where)
                if is_grey(row.jpeg, where) != self._observed.grey:
                    raise DemosError(
                        f"The picture {where} is {'coloured' if self._observed.grey else 'grey'}, "
                        "and the first one is not: a Minari dataset has pictures of one kind."
                    )
                self._picture, self._frame = row.jpeg, self._frame + 1
                if not self._as_jpeg:
                    self._pixels = decode(row.jpeg, where, grey=self._observed.grey)
            if self._picture is None:
                raise DemosError(
                    f"There is no picture {where}, and Minari needs one: drop the step."
                )
            jpegs.append(self._picture)
            frames.append(self._frame)
            if self._pixels is not None:
                pixels.append(self._pixels)
        self._columns.numbers("infos/frame", np.array(frames, np.int64))
        column = self._observed.column(files.IMAGE)
        if self._as_jpeg:
            self._columns.blobs(column, jpegs)
        else:
            self._columns.numbers(column, np.array(pixels, np.uint8))
            self._columns.blobs(f"infos/{files.JPEG}", jpegs)


def _more(row: Row) -> str:
    """What has no column of its own, as JSON."""
    more: dict[str, Any] = {}
    if row.step.terms:
        # JSON has neither NaN nor infinity.
        more["terms"] = {
            name: value if math.isfinite(value) else repr(value)
            for name, value in row.step.terms.items()
        }
    if row.marks:
        more["marks"] = list(row.marks)
    if row.dropped is not None:
        more["dropped"] = row.dropped
    if "\0" in row.step.stop_reason:
        more["stop_reason"] = row.step.stop_reason
    return json.dumps(more)
