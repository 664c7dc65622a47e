"""Servos on one bus that pull tendons, by tension or length: Dynamixel and Feetech.

`ServoBus` (`bus`) is the bus of a rig, with a `TendonServo` (`servo`) for each servo, which reads
and writes its registers and detects its faults; `bus` also has the drivers that a profile names.
`settings` has the families and models of `servos.toml` and the keys of servos. `simulation` has the
servos of a twin with their load. Only `serial_port` needs `dynamixel_sdk`, for bytes and packets.
"""
