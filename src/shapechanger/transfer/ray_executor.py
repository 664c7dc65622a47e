"""Run the jobs of a study on a Ray cluster.

The study's folder must be on a file system that all nodes share, and the package must be installed
on each node. Ray sends pickled Python objects between its nodes, so only trusted users may have
access to the cluster.
"""

from __future__ import annotations

import os
import socket
from collections.abc import Iterable
from contextlib import suppress
from typing import Any, Final

from shapechanger.errors import StudyError, needing_extra
from shapechanger.transfer.executor import Event, Executor, Job, OnProgress, failure_of, throttled

# Set before Ray is imported; otherwise Ray reports usage statistics.
os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")

with needing_extra("ray"):
    import ray
    from ray.exceptions import RayError
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

_CONNECT_S: Final = 2.0
_ANSWER_S: Final = 8.0
_REPORT_EVERY_S: Final = 0.5
_ray: Any = ray


class RayCluster(Executor):
    """Runs jobs on the nodes of a Ray cluster, one job per core.

    The address is such as `10.0.0.1:6379`, or "auto" for this machine's cluster. None uses this
    machine's cluster, or starts Ray here for the study. If Ray already runs in this process, the
    address is ignored.
    """

    def __init__(self, address: str | None = None) -> None:
        self._address = address

    def _open(self, on_progress: OnProgress) -> None:
        self._is_own = not _ray.is_initialized()
        if self._is_own:
            if self._address is not None and self._address not in ("auto", "local"):
                host, colon, port = self._address.rpartition(":")
                if not colon or not port.isdigit() or "/" in host:
                    raise StudyError(
                        "The address of a Ray cluster must be HOST:PORT or auto, got "
                        f"{self._address!r}."
                    )
                place = host.strip("[]"), int(port)
                try:  # Without an answer, Ray would retry for 30 s.
                    socket.create_connection(place, timeout=_CONNECT_S).close()
                except (OSError, OverflowError) as error:
                    raise _no_answer(self._address, "no program listens there") from error
            try:
                _ray.init(address=self._address, logging_level="ERROR", log_to_driver=False)
            except (ConnectionError, ValueError, RuntimeError, RayError) as error:
                reason = (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(".")
                raise _no_answer(self._address or "this machine", reason) from error
        self._names: dict[Any, str] = {}
        # The board of progress runs on the node of this program, because other nodes may be lost.
        here = NodeAffinitySchedulingStrategy(_ray.get_runtime_context().get_node_id(), soft=False)
        board = _ray.remote(num_cpus=0, max_restarts=-1, scheduling_strategy=here)(_Board)
        self._board: Any = board.remote()
        self._perform: Any = _ray.remote(num_cpus=1, max_retries=0)(_perform)

    def _begin(self, job: Job) -> None:
        task = self._perform.remote(job.function, job.arguments, job.name, self._board)
        self._names[task] = job.name

    def _events(self) -> Iterable[Event]:
        done, _ = _ray.wait(list(self._names), timeout=_REPORT_EVERY_S)
        # While the board restarts, no progress is reported.
        with suppress(RayError):
            found: dict[str, int] = _ray.get(self._board.take.remote(), timeout=_ANSWER_S)
            for name in found.keys() & set(self._names.values()):
                yield name, "steps", found[name]
        for task in done:
            name = self._names.pop(task)
            try:
                yield name, "done", _ray.get(task)
            except RayError as error:  # The worker or its node is gone.
                yield name, "lost", type(error).__name__

    def _close(self) -> None:
        for task in self._names:
            _ray.cancel(task, force=True)
        if self._is_own:
            _ray.shutdown()


def _no_answer(address: str, reason: str) -> StudyError:
    return StudyError(
        f"Ray at {address} does not answer ({reason}): start it with `ray start --head`, or give "
        "the --address that it prints."
    )


class _Board:
    def __init__(self) -> None:
        self._steps: dict[str, int] = {}

    def put(self, name: str, steps: int) -> None:
        self._steps[name] = steps

    def take(self) -> dict[str, int]:
        steps, self._steps = self._steps, {}
        return steps


def _perform(function: Any, arguments: tuple[Any, ...], name: str, board: Any) -> Any:
    report = throttled(lambda steps: board.put.remote(name, steps), _REPORT_EVERY_S)
    return failure_of(function, arguments, report)
