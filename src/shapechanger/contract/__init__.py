"""The promises of envs to learners, studies and recorders, and of worlds to simulated hardware.

`env_ref` identifies an env as a value, reads its traits and defines performance metrics.
`world` is the interface of every world that a robot's twin senses and moves in. `plan` and `limits`
are the numbers and pure functions of a robot's limits, for its guard and for simulations. `testing`
is the exam of every env; begin there to write a new one.
"""
