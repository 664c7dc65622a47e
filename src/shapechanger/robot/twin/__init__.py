"""Simulated hardware: a board with pins, chips, servos and a world, below the real drivers.

`robot` serves a robot on its twin and operates it; `in_process` runs robot and twin in this
process. `start` runs a board as a process of its own: `board` joins a `server` with a `pin_board`,
which has `chips`, `sensors`, `servos` and a `world`, and it speaks `messages`. A robot's processes
reach it through `hardware` (`board_client`, `gpio_pins`). `signals` has the ledger of all outputs,
and `wiring` and `oracle` judge from it what the robot did.
"""
