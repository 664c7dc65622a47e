import collections.abc
import types
import typing

import numpy
import numpy.typing

from mujoco._structs import MjData, MjModel

_Arrays: typing.TypeAlias = tuple[
    numpy.typing.NDArray[numpy.float64], numpy.typing.NDArray[numpy.float64]
]

class Rollout:
    def __init__(self, *, nthread: int | None = None) -> None: ...
    def __enter__(self) -> typing.Self: ...
    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc_val: BaseException | None,
        exc_tb: types.TracebackType | None,
    ) -> None: ...
    def close(self) -> None: ...
    def rollout(
        self,
        model: MjModel | collections.abc.Sequence[MjModel],
        data: MjData | collections.abc.Sequence[MjData],
        initial_state: numpy.typing.ArrayLike,
        control: numpy.typing.ArrayLike | None = None,
        *,
        control_spec: int = ...,
        skip_checks: bool = False,
        nstep: int | None = None,
        initial_warmstart: numpy.typing.ArrayLike | None = None,
        state: numpy.typing.ArrayLike | None = None,
        sensordata: numpy.typing.ArrayLike | None = None,
        chunk_size: int | None = None,
    ) -> _Arrays: ...

def rollout(
    model: MjModel | collections.abc.Sequence[MjModel],
    data: MjData | collections.abc.Sequence[MjData],
    initial_state: numpy.typing.ArrayLike,
    control: numpy.typing.ArrayLike | None = None,
    *,
    control_spec: int = ...,
    skip_checks: bool = False,
    nstep: int | None = None,
    initial_warmstart: numpy.typing.ArrayLike | None = None,
    state: numpy.typing.ArrayLike | None = None,
    sensordata: numpy.typing.ArrayLike | None = None,
    chunk_size: int | None = None,
    persistent_pool: bool = False,
) -> _Arrays: ...
def shutdown_persistent_pool() -> None: ...
