"""Run commands with little memory, processor time and disk, each in a separate process.

It reads lists of arguments as lines of JSON, and prints exit code and output of each command. The
modules are imported once, before the limits are set.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import sys
import traceback
from pathlib import Path

import h5py  # noqa: F401
import minari  # noqa: F401
import pyarrow.parquet  # noqa: F401
import simplejpeg  # noqa: F401

from shapechanger.cli import main
from shapechanger.demos import recording, report  # noqa: F401
from shapechanger.demos.cloning import learn  # noqa: F401
from shapechanger.demos.exchange import import_recording  # noqa: F401

MEMORY = 384 << 20
"""Bytes that a command may allocate. An image of the largest allowed size needs 48 MiB."""

CPU_S = 10
"""Processor time that a command may take, s."""

DISK = 64 << 20
"""Largest file that a command may write, bytes."""


def limited(arguments: list[str]) -> int:
    mapped = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    for limit, most in (
        (resource.RLIMIT_AS, mapped + MEMORY),
        (resource.RLIMIT_CPU, CPU_S),
        (resource.RLIMIT_FSIZE, DISK),
    ):
        resource.setrlimit(limit, (most, most))
    try:
        main(arguments)
    except SystemExit as error:
        return error.code if isinstance(error.code, int) else int(bool(error.code))
    except BaseException:
        traceback.print_exc()
        return 99
    return 0


def run(arguments: list[str]) -> tuple[int, str]:
    ours, theirs = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.dup2(theirs, 1)
        os.dup2(theirs, 2)
        sys.stdout, sys.stderr = os.fdopen(1, "w"), os.fdopen(2, "w")
        code = 98
        with contextlib.suppress(BaseException):
            code = limited(arguments)
            sys.stdout.flush()
            sys.stderr.flush()
        os._exit(code)
    os.close(theirs)
    with os.fdopen(ours, errors="replace") as output:
        text = output.read()
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), text


if __name__ == "__main__":
    for line in sys.stdin:
        print(json.dumps(run(json.loads(line))), flush=True)
