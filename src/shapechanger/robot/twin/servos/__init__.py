"""Simulated servos of a bus: Dynamixel and Feetech.

`rig` has the servos of a robot by tendon and `bus` their bus. Below them, `servo` is one servo with
its registers, and `motor` its motor, its tendon and the load. They execute instructions; bytes and
packets are left to the SDK, below the driver's port. Assumptions are marked "assumed" and listed in
`servo`.
"""
