"""Simulated hardware: a board with pins, chips, servos and a world, below the real drivers.

`robot` serves a robot on its twin and operates it. `start` runs a board as a separate process:
`board` joins a `server` with a `pin_board`, which has `sensors`, `servos` and a world of `place`.
A robot's processes reach it through `hardware`, in `messages`. `signals` has the ledger of all
outputs, and `wiring` and `judge` judge from it what the robot did.
"""
