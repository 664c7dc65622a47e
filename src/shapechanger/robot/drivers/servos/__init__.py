"""Servos on one bus that pull tendons, by tension or length: Dynamixel and Feetech.

`ServoBus` (`bus`) is the bus of a rig, with a `TendonServo` (`tendon`) for each servo, which
detects its faults. `output` has the drivers that a profile names. Below them, `settings` has the
keys and units of servos, `family` the families and models of `servos.toml`, and `registers` the
instructions. `simulation` has the servos of a twin with their load. Only `serial_port` needs
`dynamixel_sdk`, for bytes and packets.
"""
