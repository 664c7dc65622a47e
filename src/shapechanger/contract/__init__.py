"""The promises of envs to learners, studies and recorders, and of worlds to simulated hardware.

`env_ref` identifies an env as a value and defines performance metrics; `testing` is the exam of
every env. `world` is the interface of the worlds of simulated robots. `plan` and `limits` define
the limits of a robot, for its guard and for simulations.
"""
