"""Policies on board: each drives from a separate process, as a normal client.

The process can reach the outputs only through the link, so lease, deadline, guard and takeovers
apply to it as to any client. A policy that crashes loses its connection, and so its control; if it
hangs, the deadline of its last command passes.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import sys
from asyncio.subprocess import PIPE
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import msgspec

from shapechanger.errors import UnknownName
from shapechanger.robot.daemon.client import Declined
from shapechanger.robot.daemon.plan import DaemonPlan
from shapechanger.robot.guard.running import run_normally
from shapechanger.robot.link.address import address_here
from shapechanger.robot.link.messages import PolicyState

_log = logging.getLogger(__name__)

ENDING: Final = ".onnx"
"""Ending of the files of policies that run on board."""

_END_S: Final = 2.0  # Time for a policy to release the robot and exit.
_MOST_NAMES: Final = 256
_LONGEST: Final = 1024  # Longest line that a policy's process may write, bytes.


class _Said(msgspec.Struct):
    """Message of a policy's process: a note on its state, or why it failed."""

    note: str = ""
    failed: str = ""


def policies_in(folder: Path) -> list[str]:
    """Return the first 256 names of policies in a folder, sorted; empty if it cannot be read."""
    files: list[str] = []
    with contextlib.suppress(OSError):
        files = sorted(path.name for path in folder.iterdir() if path.suffix == ENDING)
    return [name.removesuffix(ENDING) for name in files][:_MOST_NAMES]


class PolicyRunner:
    """Runs at most one policy of a folder."""

    def __init__(self, plan: DaemonPlan, post: Callable[[PolicyState], None]) -> None:
        self._plan = plan
        self._post = post
        self._command: Sequence[str] = (sys.executable, "-P", "-m", plan.pilot)
        self._robot: dict[str, str] = {}
        self._running = ""
        self._text = ""
        self._task: asyncio.Task[None] | None = None

    def serve(self, port: int, key: str, fingerprint: bytes) -> None:
        """Set how policies reach the robot, and start the policy of the plan, if there is one."""
        self._robot = {
            "name": self._plan.card.robot,
            "address": str(address_here(self._plan.host, port)),
            "key": key,
            "fingerprint": fingerprint.hex() if fingerprint else "insecure",
        }
        if self._plan.policy:
            try:
                self.run(self._plan.policy)
            except Declined as error:
                _log.warning("%s", error)

    def state(self) -> PolicyState:
        """Return the message that describes the policies."""
        names = policies_in(Path(self._plan.policies)) if self._plan.policies else []
        return PolicyState(names=tuple(names), running=self._running, text=self._text)

    def run(self, name: str) -> None:
        """End the running policy, and start the policy `name` unless it is ""."""
        if not self._plan.policies:
            raise Declined("This robot has no policies on board: serve it with --policy.")
        names = policies_in(Path(self._plan.policies))
        if name and name not in names:
            raise Declined(str(UnknownName("policy on board", name, names)))
        if name == self._running:
            raise Declined(f"{name} runs already." if name else "No policy runs.")
        before = self._task
        self._task = asyncio.get_running_loop().create_task(self._supervise(before, name))

    async def close(self) -> None:
        """End the policy that runs."""
        await _cancel(self._task)

    async def _supervise(self, before: asyncio.Task[None] | None, name: str) -> None:
        await _cancel(before)
        if not name:
            self._report("", "")
            return
        self._report(name, "It starts.")
        process = await asyncio.create_subprocess_exec(
            *self._command, stdin=PIPE, stdout=PIPE, limit=_LONGEST
        )
        # Commands and images take precedence over the computation of a policy.
        run_normally(process.pid)
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            failure = await self._listen(process.stdin, process.stdout, name)
        finally:
            process.stdin.close()  # The process should then exit.
            try:
                await asyncio.wait_for(process.wait(), _END_S)
            except TimeoutError:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
            self._running = ""
        text = failure or f"its process ended with code {process.returncode}."
        _log.warning("%s ended: %s", name, text)
        self._report("", f"{name} ended: {text}")

    async def _listen(
        self, stdin: asyncio.StreamWriter, stdout: asyncio.StreamReader, name: str
    ) -> str:
        """Send its task to a policy's process, report its notes, and return its failure, or ""."""
        task = {"policy": str(Path(self._plan.policies, name + ENDING)), "robot": self._robot}
        failure = ""
        try:
            # The key is sent through a pipe, because other users can read command lines. The pipe
            # stays open, so that the policy's process can detect the end of this process.
            stdin.write(json.dumps(task).encode() + b"\n")
            await stdin.drain()
            while line := await stdout.readline():
                with contextlib.suppress(msgspec.MsgspecError, UnicodeDecodeError):
                    said = msgspec.json.decode(line, type=_Said)
                    failure = said.failed or failure
                    self._report(name, said.note or self._text)
        except ConnectionError:
            pass  # The process has ended; its exit code is reported.
        except ValueError:
            failure = failure or f"its process wrote a line of more than {_LONGEST} bytes."
        return failure

    def _report(self, running: str, text: str) -> None:
        if (running, text) != (self._running, self._text):
            self._running, self._text = running, text
            self._post(self.state())


async def _cancel(task: asyncio.Task[None] | None) -> None:
    if task is not None:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
