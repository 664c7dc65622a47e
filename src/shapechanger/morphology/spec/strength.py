"""Strength of actuators: how much force they exert for what they are told."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import mujoco
import numpy as np

from shapechanger.errors import MorphologyError
from shapechanger.morphology.spec.elements import require_free_name
from shapechanger.morphology.spec.references import references

_GAIN: Final = mujoco.mjtGain
_BIAS: Final = mujoco.mjtBias
_LINEAR_GAINS: Final = (_GAIN.mjGAIN_FIXED, _GAIN.mjGAIN_AFFINE)
# Constant, length and velocity terms of an affine gain or bias.
_TERMS: Final = slice(0, 3)
# Peak force and, where that is negative, the force that it is derived from.
_MUSCLE_FORCE: Final = slice(2, 4)


def add_motor(spec: mujoco.MjSpec, name: str, gear: float) -> None:
    """Add a motor to the joint of its name, with controls from -1 to 1.

    Args:
        spec: The specification.
        name: Name of the joint and of the motor.
        gear: Torque, N·m, or force, N, for a control of 1.

    Raises:
        MorphologyError: If an actuator has the name.
    """
    require_free_name(spec, "actuator", name)
    motor = spec.add_actuator(
        name=name,
        target=name,
        trntype=mujoco.mjtTrn.mjTRN_JOINT,
        ctrllimited=mujoco.mjtLimited.mjLIMITED_TRUE,
        ctrlrange=[-1.0, 1.0],
        gear=[gear, 0.0, 0.0, 0.0, 0.0, 0.0],
    )
    motor.set_to_motor()


def is_motor(actuator: mujoco.MjsActuator) -> bool:
    """Return whether the force does not depend on where the actuator is: gain times control."""
    return actuator.gaintype == _GAIN.mjGAIN_FIXED and actuator.biastype == _BIAS.mjBIAS_NONE


def scale_strength(actuator: mujoco.MjsActuator, factor: float) -> None:
    """Scale the force of an actuator; a servo keeps its targets, and a muscle its lengths.

    The gear of a motor scales. The gear of any other actuator also scales what it measures, so of a
    servo the gains, the bias and the force range scale instead.

    Args:
        actuator: The actuator.
        factor: New force over the old one.

    Raises:
        MorphologyError: If the actuator's gains have no common scale.
    """
    if is_motor(actuator):
        actuator.gear = actuator.gear * factor
        return
    gain, bias = np.array(actuator.gainprm), np.array(actuator.biasprm)
    if actuator.gaintype == _GAIN.mjGAIN_MUSCLE and actuator.biastype == _BIAS.mjBIAS_MUSCLE:
        for parameters in (gain, bias):
            force = parameters[_MUSCLE_FORCE]
            # A negative peak force stands for an automatic one.
            parameters[_MUSCLE_FORCE] = np.where(force > 0.0, force * factor, force)
    elif actuator.gaintype in _LINEAR_GAINS and actuator.biastype in (
        _BIAS.mjBIAS_NONE,
        _BIAS.mjBIAS_AFFINE,
    ):
        gain[_TERMS] *= factor
        bias[_TERMS] *= factor
    else:
        raise MorphologyError(
            f"{actuator.name!r} is an actuator whose gains have no common scale, so its strength "
            "cannot be scaled: write new gains into the model instead."
        )
    actuator.gainprm, actuator.biasprm = gain, bias
    actuator.forcerange = actuator.forcerange * factor


def scale_clamps(spec: mujoco.MjSpec, factors: Mapping[str, float]) -> None:
    """Scale the largest force of the joints and tendons whose actuators have all become as strong.

    Without it, a stronger motor of a joint with `actuatorfrcrange` would change nothing.

    Args:
        spec: The specification.
        factors: New force over the old one, by the names of actuators.
    """
    driven = [(each.element, each.holder.name) for each in references(spec, "actuator")]
    for kind, elements in (
        (mujoco.mjtObj.mjOBJ_JOINT, spec.joints),
        (mujoco.mjtObj.mjOBJ_TENDON, spec.tendons),
    ):
        for element in elements:
            target = (kind, element.name)
            scales = {factors.get(name, 1.0) for driven_one, name in driven if driven_one == target}
            if len(scales) == 1 and np.any(element.actfrcrange):
                element.actfrcrange = element.actfrcrange * abs(scales.pop())
