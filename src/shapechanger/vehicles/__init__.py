"""Car, tank, truck and boat: the same task of driving with four bodies, and in four places.

Begin with `envs`, the Gymnasium envs, and `world`, which simulates a vehicle on a course: `bodies`
models vehicles, `courses` lays out and draws places, `cameras` render and corrupt images, and
`expert` drives a known course. `waypoints` is the action that all vehicles share; `cloning` trains
camera policies from demonstrations; `remote` and `twin` reach real and simulated robots.
"""
