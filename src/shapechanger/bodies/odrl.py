"""Bodies of the locomotion tasks of ODRL (Off-Dynamics RL, NeurIPS 2024), as edits.

ODRL publishes one model file per task; the names are those of its files. These edits give bodies
that move equally: masses, inertias, joints, geoms, limits, frictions and gravity agree to 1e-12, in
the world's frame at the start pose. The origins of some bodies, which move nothing, lie elsewhere.

ODRL's own files of these robots were not at hand; all 80 targets were read on 2026-11-25 in two
conversions by others, which agree where both were read:

- `comp_flow_jax/envs/assets_v3/*.xml` of github.com/xingcw/CompositeFlow, commit 322fe9a: ODRL's
  files as MuJoCo 2.3.3 has written them, with six digits (ants, half cheetahs, and some of the
  other two). Of the hopper and the walker ODRL's have `coordinate="global"`, which MuJoCo has
  removed since.
- `env/mujoco/assets/{hopper,walker2d}_*.xml` of
  github.com/shivambhagat79/off-dynamics-explorative-rl, commit b13843f: hoppers and walkers in
  local coordinates and round numbers.

The tasks and their levels are those of `envs/mujoco/call_mujoco_env.py` of
github.com/OffDynamicsRL/off-dynamics-rl, commit d1a69cd. Where only six digits are known, such as a
half-length of 0.0777817, the round ends that give it, (0, 0, 0) and (0.11, 0, -0.11), are meant.
That every half cheetah weighs 14 kg is the setting `settotalmass` of Gym's file, which a file that
MuJoCo has written lacks; `envs/mujoco/assets/halfcheetah_morph_easy.xml` of
github.com/shivambhagat79/off-dynamics-rl, commit 995bf26, a changed thigh of ODRL, has kept it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from shapechanger.morphology.body import Body
from shapechanger.morphology.edits.edit import Edit
from shapechanger.morphology.edits.joints import JointRange
from shapechanger.morphology.edits.places import PlaceBody, PlaceGeom, TotalMass
from shapechanger.morphology.edits.values import Friction, Gravity, Stretch

_LEVELS: Final = ("easy", "medium", "hard")
_FACTORS: Final = (0.1, 0.5, 2.0, 5.0)
# Of a range of angles, and of the length of the ant's shanks.
_SHARES: Final = (0.8, 0.5, 0.2)
_G: Final = 9.81  # m/s²
_CHEETAH_KG: Final = 14.0  # `settotalmass` of half_cheetah.xml, which holds for every body.
# Gym's walker, which ODRL changes, has one foot of less friction than the other; Gymnasium's v5 has
# made them equal.
_RIGHT_FOOT: Final = Friction("foot_geom", to=0.9)


def _all_friction(factor: float) -> Body:
    """All three coefficients of all geoms, including the floor."""
    kinds = ("sliding", "torsional", "rolling")
    return tuple(Friction("*", scale=factor, component=kind) for kind in kinds)


def _narrowed(share: float, **ranges: tuple[float, float]) -> Body:
    """Ranges of joints, rad, multiplied by a share."""
    return tuple(
        JointRange(joint, share * lower, share * upper) for joint, (lower, upper) in ranges.items()
    )


def _shifts(
    friction: Callable[[float], Body], shifts: Mapping[str, tuple[Body, Body, Body]], *first: Edit
) -> dict[str, Body]:
    """Bodies of a robot by the name of the task without the robot.

    Args:
        friction: Edits of a factor of friction.
        shifts: Edits of each level by the name of the shift.
        *first: Edits that all of them begin with.
    """
    bodies: dict[str, Body] = {"": first}
    for factor in _FACTORS:
        bodies[f"-friction-{factor}"] = (*first, *friction(factor))
        bodies[f"-gravity-{factor}"] = (*first, Gravity((0.0, 0.0, -_G * factor)))
    for shift, edits in shifts.items():
        for level, each in zip(_LEVELS, edits, strict=True):
            bodies[f"-{shift}-{level}"] = (*first, *each)
    return bodies


def _each(make: Callable[..., Body], *values: tuple[float, ...]) -> tuple[Body, Body, Body]:
    """Edits of the three levels, from the numbers of each."""
    easy, medium, hard = (make(*level) for level in values)
    return easy, medium, hard


def _shares(make: Callable[[float], Body]) -> tuple[Body, Body, Body]:
    """Edits of the three levels, from the share that each leaves."""
    easy, medium, hard = map(make, _SHARES)
    return easy, medium, hard


def _ankles(share: float) -> Body:
    """Ankles keep their lower limit of 30 degrees and lose the end of their 40."""
    upper = {0.8: 62.0, 0.5: 50.0, 0.2: 38.0}[share]
    return (
        *(JointRange(f"ankle_{leg}", math.radians(30.0), math.radians(upper)) for leg in (1, 4)),
        *(JointRange(f"ankle_{leg}", math.radians(-upper), math.radians(-30.0)) for leg in (2, 3)),
    )


ANT: Final = _shifts(
    _all_friction,
    {
        "kinematic-anklejnt": _shares(_ankles),
        "kinematic-hipjnt": _shares(
            lambda share: (
                JointRange("hip_*", math.radians(-30.0 * share), math.radians(30.0 * share)),
            )
        ),
        "morph-alllegs": _shares(lambda share: (Stretch("shank_*", share),)),
        "morph-halflegs": _shares(lambda share: (Stretch("shank_[12]", share),)),
    },
)


def _cheetah_torso(half: float) -> Body:
    """A shorter torso; the head keeps its size and its distance from the end."""
    return (
        PlaceGeom("torso", (-half, 0.0, 0.0), (half, 0.0, 0.0)),
        PlaceGeom("head", middle=(half + 0.1, 0.0, 0.1)),
        PlaceBody("bthigh", (-half, 0.0, 0.0)),
        PlaceBody("fthigh", (half, 0.0, 0.0)),
        TotalMass(_CHEETAH_KG),
    )


def _cheetah_thigh(back_x: float, back_z: float, front_x: float, front_z: float) -> Body:
    """Shorter thighs, whose knees lie where they end, and shins of another length and direction."""
    knees = {"b": (back_x, 0.0, back_z), "f": (front_x, 0.0, front_z)}
    ankles = {"b": (-0.13, 0.0, -0.15), "f": (0.11, 0.0, -0.13)}
    origin = (0.0, 0.0, 0.0)
    return (
        *(PlaceGeom(f"{side}thigh", origin, knee) for side, knee in knees.items()),
        *(PlaceBody(f"{side}shin", knee) for side, knee in knees.items()),
        *(PlaceGeom(f"{side}shin", origin, ankle) for side, ankle in ankles.items()),
        *(PlaceBody(f"{side}foot", ankle) for side, ankle in ankles.items()),
        TotalMass(_CHEETAH_KG),
    )


HALF_CHEETAH: Final = _shifts(
    _all_friction,
    {
        "kinematic-footjnt": _shares(
            lambda share: _narrowed(share, bfoot=(-0.4, 0.785), ffoot=(-0.5, 0.5))
        ),
        "kinematic-thighjnt": _shares(
            lambda share: _narrowed(share, bthigh=(-0.52, 1.05), fthigh=(-1.0, 0.7))
        ),
        "morph-thigh": _each(
            _cheetah_thigh,
            (0.11, -0.11, -0.09, -0.1),
            (0.08, -0.08, -0.07, -0.08),
            (0.02, -0.02, -0.04, -0.05),
        ),
        "morph-torso": _each(_cheetah_torso, (0.4,), (0.25,), (0.1,)),
    },
)


def _planar_torso(top: float, radius: float) -> Body:
    """A torso of the hopper or the walker that is higher and thicker."""
    return (PlaceGeom("torso_geom", (0.0, 0.0, -0.2), (0.0, 0.0, top), radius=radius),)


_TORSOS: Final = _each(_planar_torso, (0.28, 0.075), (0.44, 0.1), (0.6, 0.125))


def _hopper_foot(back: float, front: float, radius: float) -> Body:
    """A foot that is smaller all round, under the same joint."""
    return (PlaceGeom("foot_geom", (back, 0.0, 0.1), (front, 0.0, 0.1), radius=radius),)


HOPPER: Final = _shifts(
    # The floor keeps its friction of 1, and MuJoCo takes the larger one of two geoms.
    lambda factor: (Friction("*_geom", scale=factor),),
    {
        "kinematic-footjnt": _shares(
            lambda share: _narrowed(share, foot_joint=(math.radians(-45.0), math.radians(45.0)))
        ),
        "kinematic-legjnt": _shares(
            lambda share: _narrowed(share, leg_joint=(math.radians(-150.0), 0.0))
        ),
        "morph-foot": _each(
            _hopper_foot,
            (-0.234, 0.078, 0.048),
            (-0.208, 0.026, 0.036),
            (-0.182, -0.026, 0.024),
        ),
        "morph-torso": _TORSOS,
    },
)


def _walker_legs(knee: float) -> Body:
    """Knees lower or higher: thighs of another length, and shins that end where they did.

    Args:
        knee: Height of the knee relative to the hip, m.
    """
    sides = ("", "_left")
    # The shin's joint lies 0.25 m above its origin.
    origin = knee - 0.25
    return (
        *(PlaceGeom(f"thigh{s}_geom", (0.0, 0.0, 0.0), (0.0, 0.0, knee)) for s in sides),
        *(PlaceBody(f"leg{s}", (0.0, 0.0, origin)) for s in sides),
        *(PlaceGeom(f"leg{s}_geom", (0.0, 0.0, 0.25), (0.0, 0.0, -0.95 - origin)) for s in sides),
        *(PlaceBody(f"foot{s}", (0.2, 0.0, -1.05 - origin)) for s in sides),
    )


WALKER2D: Final = _shifts(
    _all_friction,
    {
        "kinematic-footjnt": _shares(
            lambda share: _narrowed(
                share,
                foot_joint=(math.radians(-45.0), math.radians(45.0)),
                foot_left_joint=(math.radians(-45.0), math.radians(45.0)),
            )
        ),
        "kinematic-thighjnt": _shares(
            lambda share: _narrowed(
                share,
                thigh_joint=(math.radians(-150.0), 0.0),
                thigh_left_joint=(math.radians(-150.0), 0.0),
            )
        ),
        "morph-leg": _each(_walker_legs, (-0.55,), (-0.7,), (-0.85,)),
        "morph-torso": _TORSOS,
    },
    _RIGHT_FOOT,
)


def published(robot: str, bodies: Mapping[str, Body]) -> dict[str, Body]:
    """Return bodies by their full names, such as `odrl-ant-friction-0.1`.

    Args:
        robot: Name of the robot in ODRL.
        bodies: Bodies of this module.
    """
    return {f"odrl-{robot}{task}": body for task, body in bodies.items()}
