"""Dynamixel servos on one bus that pull tendons, by tension or length, with protocol 2.0.

`ServoBus` (`bus`) is the bus of a rig, and `Homing` finds the zeros of its tendons. `output` and
`sensor` are the drivers that a profile names. Below them, `settings` has models, servos and their
units, `health` the fault detection, and `protocol` registers and instructions. Only `serial_port`
needs `dynamixel_sdk`, for bytes and packets.
"""
