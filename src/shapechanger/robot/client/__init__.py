"""Client of a robot on the network.

`client.RobotClient` commands a robot. `known_robots` stores the robots that the user trusts,
`discovery` finds robots on the local network, `recordings` downloads their episodes, and
`observations` turns their messages into observations and rewards of Gymnasium envs.
"""
