"""Simulated hardware: a board with pins, chips, servos and a world, below the real drivers.

`robot` serves a robot on its twin, and `operator` moves and breaks it. `start` runs a `board` as a
separate process: a `pin_board` with its world, which a robot's processes reach through `hardware`,
by calls of `rpc`. `ledger` has all changes of outputs, and evaluates them with the wiring.
"""
