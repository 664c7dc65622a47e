"""Simulated hardware: a board with pins, chips, servos and a world, below the real drivers.

`robot` serves a robot on its twin; `operator` moves the vehicle and causes faults. `start` runs a
`board` as a separate process: a `pin_board` with its world. A robot's processes reach the board
through `hardware`, by calls of `rpc`. `ledger` reads and evaluates all changes of outputs.
"""
