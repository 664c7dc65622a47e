"""Simulated Dynamixel servos, which speak protocol 2.0 byte by byte.

`bus` has the bus and its servos, `rig` the servos of a robot by tendon, `port` a port for the
SDK. Below them, `protocol` has packets and registers, `servo` one servo, and `motor` its motor,
its tendon and the load. The SDK's own packet code never runs on this side, so each side tests the
other. Assumptions are marked "assumed" and listed in `servo`.
"""
