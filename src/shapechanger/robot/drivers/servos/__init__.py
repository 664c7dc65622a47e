"""Servos on one bus that pull tendons, by tension or length: Dynamixel and Feetech.

`ServoBus` (`bus`) is the bus of a rig, with a `TendonServo` (`tendon`) for each servo, which
detects its faults. `output` has the drivers that a profile names. Below them, `settings` has the
keys and units of servos, `family` the families and models, and `registers` the instructions.
`simulation` has a servo of a twin, and `rig` the bus of a twin and its load. Only `serial_port`
needs `dynamixel_sdk`, for bytes and packets.
"""
