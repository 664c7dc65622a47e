"""Servos on one bus that pull tendons, by tension or length: Dynamixel and Feetech.

`ServoBus` (`bus`) is the bus of a rig, and `Homing` finds the zeros of its tendons. `output` has
the drivers that a profile names. Below them, `settings` has models, servos and their units,
`health` the fault detection, `family` what differs between families, and `registers` the
instructions. `simulation` has a servo of a twin, and `rig` the bus of a twin and its load. Only
`serial_port` needs `dynamixel_sdk`, for bytes and packets.
"""
