"""A car, a tank, a truck and a boat that drive on courses of four kinds.

Start with `envs`, the Gymnasium envs, and `world`, which simulates a vehicle on a course. `bodies`
models vehicles, `courses` lays out and draws courses, `cameras` renders and corrupts images, and
`expert` drives a known course. `waypoints` defines the action that all vehicles share. `cloning`
trains camera policies from demonstrations. `remote` and `twin` connect to robots and twins.
"""
