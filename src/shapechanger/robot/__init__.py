"""Robots: the software on them, the client of a workstation, and simulated hardware.

On the robot, such as a Raspberry Pi, `profile` describes it, `guard` owns its outputs, `daemon`
serves it on the network, `drivers` and `cameras` access its hardware, `setup` calibrates it,
`check` checks it, and `console` is its web page. `link` is the protocol, `client` is the
workstation's side of it, and `twin` simulates a board with its chips below the real drivers.
"""
