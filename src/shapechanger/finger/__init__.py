"""A human index finger of four joints, pulled by seven tendons: simulated, or on a rig.

Start with `anatomy` (joints, tendons, sources of all numbers), `parameters` (the differences
between fingers) and `reach` (the env `Finger-v1`). In `track`, the fingertip follows one of the
`paths`. `controller` moves a finger, `gap` draws fingers like a rig's, `identify` finds a finger's
parameters from a log, `remote` runs the tasks on a rig, `twin` simulates a rig, and `gpu` steps
many fingers at once.
"""

from __future__ import annotations

from shapechanger.errors import needing_extra

with needing_extra("sim"):
    import mujoco  # noqa: F401  # pyright: ignore[reportUnusedImport]
