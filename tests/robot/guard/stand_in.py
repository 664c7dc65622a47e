"""Stand-in for the daemon: arms, and commands half steering and throttle 100 times a second.

It appends its actions to the record named in its part of the plan. With `commands`, it sends only
that many commands; with `ends`, it then ends the guard. Only the first daemon of a record drives;
later ones only send heartbeats.
"""

import contextlib
import json
import os
import select
import socket
import sys
import time


def main(arguments: list[str]) -> None:
    """Drive until the guard or the supervisor exits."""
    fds = dict(zip(arguments[::2], map(int, arguments[1::2]), strict=True))
    plan = json.loads(os.pread(fds["--plan-fd"], 1 << 20, 0))["daemon"]
    heart = socket.socket(fileno=fds["--heartbeat-fd"])
    guard = socket.socket(fileno=fds["--guard-fd"])
    guard.setblocking(False)
    record = os.open(plan["record"], os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def note(**fields: object) -> None:
        line = json.dumps({"t": time.monotonic_ns(), "pid": os.getpid(), **fields}) + "\n"
        os.write(record, line.encode())

    def send(kind: str, **fields: object) -> None:
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
            return  # The supervisor exited.
        heart.send(b".")
        if not drives:
            continue
        with contextlib.suppress(BlockingIOError):
            while state := guard.recv(1 << 16):
                was_armed = json.loads(state)["armed"]
        if not was_armed and seq == 0:
            send("arm")
        if was_armed and seq < limit:
            seq += 1
            send("command", session=1, seq=seq, ttl_ms=10_000, values=[0.5, 0.5])
            note(command=seq)
        elif seq == limit and plan.get("ends"):
            send("end")
            seq += 1


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError, ConnectionResetError):  # The guard exited.
        main(sys.argv[1:])
