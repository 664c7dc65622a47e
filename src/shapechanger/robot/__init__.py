"""Software that runs on the robot, such as a Raspberry Pi.

`profile` describes a robot, `guard` owns its outputs, `daemon` serves it on the network, `drivers`
and `cameras` access its hardware, `setup` calibrates and checks it, and `console` is its web page.
"""
