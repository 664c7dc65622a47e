"""Bodies of the locomotion tasks of ODRL (Off-Dynamics RL, NeurIPS 2024), as edits.

ODRL publishes one model file per task; the bodies here are named after these files. The edits give
bodies that move equally: masses, inertias, joints, geoms, limits, frictions and gravity agree to
1e-12, in the world's frame at the start pose. Origins of some bodies differ, without any effect.

ODRL's own files of these robots were not available. All 80 targets were read on 2026-11-25 from two
conversions by third parties, which agree on each target that was read from both:

- `comp_flow_jax/envs/assets_v3/*.xml` of github.com/xingcw/CompositeFlow, commit 322fe9a: ODRL's
  files, written by MuJoCo 2.3.3 with six digits (ants, half cheetahs, and some hoppers and
  walkers). ODRL's files of the hopper and the walker have `coordinate="global"`, which MuJoCo has
  removed.
- `env/mujoco/assets/{hopper,walker2d}_*.xml` of
  github.com/shivambhagat79/off-dynamics-explorative-rl, commit b13843f: hoppers and walkers in
  local coordinates and round numbers.

The tasks and their levels come from `envs/mujoco/call_mujoco_env.py` of
github.com/OffDynamicsRL/off-dynamics-rl, commit d1a69cd. Where only six digits are known, such as a
half-length of 0.0777817, the edits have the round end points that give this number, (0, 0, 0) and
(0.11, 0, -0.11). Every half cheetah weighs 14 kg, because Gym's file has `settotalmass`. Files
written by MuJoCo lack this setting, but `envs/mujoco/assets/halfcheetah_morph_easy.xml` of
github.com/shivambhagat79/off-dynamics-rl, commit 995bf26, ODRL's body with a changed thigh, has
kept it.

`odrl.json` has the edits, keyed by names such as `odrl-ant-friction-0.1`. Frictions apply to all
geoms, except the hopper's floor; gravity is a factor of 9.81 m/s²; easy, medium and hard leave 0.8,
0.5 and 0.2 of the range of a joint. One foot of a walker has less friction than the other, like
Gym's; Gymnasium's v5 has made them equal.
"""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any


@cache
def odrl_bodies() -> dict[str, list[dict[str, Any]]]:
    """Return the edits of each body as JSON, keyed by the body's name."""
    return json.loads(Path(__file__).with_suffix(".json").read_bytes())


def published(robot: str) -> dict[str, list[dict[str, Any]]]:
    """Return the bodies of a robot of ODRL, such as "ant", keyed by their full names."""
    return {name: body for name, body in odrl_bodies().items() if name.split("-")[1] == robot}
