"""Stands in for the daemon: arms, and commands half throttle 100 times a second.

It writes what it does to the record whose path its part of the plan has under `record`. With
`commands` there, it falls silent after so many of them; with `ends`, it then ends the guard. Only
the first one of a record drives: those that are started after it show that they live, and wait.
"""

import contextlib
import json
import os
import select
import socket
import sys
import time


def main(arguments: list[str]) -> None:
    """Drive until the guard or the supervisor is gone."""
    fds = dict(zip(arguments[::2], map(int, arguments[1::2]), strict=True))
    plan = json.loads(os.pread(fds["--plan-fd"], 1 << 20, 0))["daemon"]
    heart = socket.socket(fileno=fds["--heartbeat-fd"])
    guard = socket.socket(fileno=fds["--guard-fd"])
    guard.setblocking(False)
    record = os.open(plan["record"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def note(**fields: object) -> None:
        line = json.dumps({"t": time.monotonic_ns(), "pid": os.getpid(), **fields}) + "\n"
        os.write(record, line.encode())

    def say(kind: str, **fields: object) -> None:
        guard.send(json.dumps({"kind": kind, "issued_ns": time.monotonic_ns(), **fields}).encode())

    with open(plan["record"]) as lines:
        drives = '"opened": "daemon"' not in lines.read()
    note(opened="daemon")
    poll = select.poll()
    poll.register(heart.fileno(), select.POLLIN)
    seq, was_armed = 0, False
    limit = plan.get("commands", 10**9)
    while True:
        if any(events & ~select.POLLOUT for _, events in poll.poll(10)):
            return  # The supervisor is gone.
        heart.send(b".")
        if not drives:
            continue
        try:
            while state := guard.recv(1 << 16):
                said = json.loads(state)
                if said["armed"] and not was_armed:
                    note(armed=True)
                was_armed = said["armed"]
                if said["refused"]:
                    note(refused=said["refused"])
        except BlockingIOError:
            pass
        if not was_armed and seq == 0:
            for garbage in plan.pop("garbage", ()):
                guard.send(garbage.encode())
            say("arm")
        if was_armed and seq < limit:
            seq += 1
            say("command", session=1, seq=seq, ttl_ms=10_000, values=[0.5, 0.5])
            note(command=seq)
        elif seq == limit and plan.get("ends"):
            say("end")
            seq += 1


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # The guard is gone.
        main(sys.argv[1:])
