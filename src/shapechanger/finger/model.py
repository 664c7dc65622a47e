"""The finger as a MuJoCo model and as an MJCF file: hinges that are moved by tendons."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final
from xml.etree import ElementTree

import msgspec
import mujoco
import numpy as np
from numpy.typing import NDArray

from shapechanger.finger.anatomy import (
    DIP_BAND,
    DIP_BY_PIP,
    DIP_COUPLING,
    END_STIFFNESS,
    JOINT_RANGE,
    JOINT_REST,
    JOINTS,
    PHALANGES,
    PHALANX_LENGTH_M,
    PHALANX_RADIUS_M,
    TENDONS,
    TISSUE_DENSITY,
)
from shapechanger.finger.parameters import NOMINAL, FingerParameters
from shapechanger.finger.tensions import TendonDrive, drive_of
from shapechanger.finger.visuals import (
    METACARPAL,
    THICKEST_M,
    THINNEST_M,
    add_anatomy,
    route_names,
)

SIM_DT: Final = 0.002
"""Simulation step, s, that is stable under any command."""
_SIM_DT_STRETCHED: Final = 0.0005
"""Simulation step with elastic tendons, s: a light spool on a stiff tendon oscillates at 100 Hz and
more."""
_SIM_DT_GEARED: Final = 0.001
"""Simulation step with elastic tendons and geared motors, s, which oscillate at some 20 Hz. `python
-m benchmarks.run finger-physics` shows the error of each step."""
_GEARED_KG: Final = 0.5
"""Mass above which motors count as geared, kg."""

# Shortest history of commands of a motor with a delay, s. Up to this delay, fingers have arrays of
# the same shapes.
_KEPT_S: Final = 0.020

FINGERTIP: Final = "fingertip"
"""Name of the site at the end of the distal phalanx."""
HOOD: Final = "extensor_hood"
"""Name of the tendon that couples the end joint with the middle one."""
TARGET: Final = "target"
"""Name of the body that marks the target of the fingertip, for images."""

# Damping ratio of a stretched tendon: cords and tissue oscillate only briefly.
_CABLE_DAMPING_RATIO: Final = 0.3
_SKIN: Final = (0.87, 0.68, 0.58, 1.0)
_HAND: Final = (0.75, 0.57, 0.48, 1.0)
# The radius of the target's mark is the tolerance of a reached target.
_MARK: Final = (0.10, 0.55, 0.25, 0.45)
_MARK_RADIUS_M: Final = 0.005
# Length of the metacarpal, two thirds of a palm, for images only.
_METACARPAL_M: Final = 0.060
# Phalanx that each joint moves, and its axis: y flexes, and z abducts.
_Y: Final = (0.0, 1.0, 0.0)
_HINGES: Final = ((0, _Y), (0, (0.0, 0.0, 1.0)), (1, _Y), (2, _Y))
# Joint limits: the smallest stable time constant, s, a damping ratio, and an impedance with which
# the limits hardly yield under full tension.
_LIMIT: Final = (2.0 * SIM_DT, 1.0)
_LIMIT_IMPEDANCE: Final = (0.99, 0.999, 0.001, 0.5, 2.0)


def build_finger(
    parameters: FingerParameters, drive: TendonDrive, *, anatomy: bool = False
) -> mujoco.MjSpec:
    """Build the MuJoCo model of a finger.

    Controls are the commands of the drive, -1 to 1, in the order of `TENDONS`. If the parameters
    have a command path, controls are tensions instead: -1 is the least and 1 the most tension; see
    `HeldTensions`. Tendons are named as in `TENDONS`. Their lengths, m, are 0 for the straight
    finger. An elastic tendon has a motor: a slide joint such as `FDP/motor` that winds it up.
    `anatomy` adds bones and tendon routes for images; the motion is the same.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "finger"
    geared = parameters.motor_kg > _GEARED_KG
    stretched = _SIM_DT_GEARED if geared else _SIM_DT_STRETCHED
    spec.option.timestep = stretched if parameters.gives else SIM_DT
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    spec.visual.headlight.ambient[:] = (0.4, 0.4, 0.4)
    spec.visual.headlight.diffuse[:] = (0.5, 0.5, 0.5)
    spec.stat.center[:] = (0.02, 0.0, -0.02)
    spec.stat.extent = 0.15
    _add_bones(spec, parameters)
    if parameters.path is not None:
        half = 0.5 * (np.array(parameters.most_tension) - parameters.least_tension)
        drive = TendonDrive(parameters.least_tension + half, half)
    for i in range(len(TENDONS)):
        _add_tendon(spec, i, parameters, drive)
    # The extensor hood is a spring that acts on the end joint outside of `DIP_BAND`.
    hood = spec.add_tendon(name=HOOD)
    hood.wrap_joint(JOINTS[2], -DIP_BY_PIP)
    hood.wrap_joint(JOINTS[3], 1.0)
    hood.stiffness = [DIP_COUPLING, 0.0, 0.0]
    hood.springlength = [-DIP_BAND, DIP_BAND]
    mark = spec.worldbody.add_body(name=TARGET, mocap=True)
    mark.add_geom(
        name=TARGET, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[_MARK_RADIUS_M, 0, 0], rgba=_MARK
    )
    if anatomy:
        add_anatomy(spec)
    return spec


def _add_bones(spec: mujoco.MjSpec, parameters: FingerParameters) -> None:
    capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
    spec.worldbody.add_geom(
        name=METACARPAL,
        type=capsule,
        size=[1.1 * PHALANX_RADIUS_M[0], 0, 0],
        fromto=[-_METACARPAL_M, 0, 0, 0, 0, 0],
        rgba=_HAND,
    )
    parent, at = spec.worldbody, 0.0
    for k, name in enumerate(PHALANGES):
        length, radius = PHALANX_LENGTH_M[k], PHALANX_RADIUS_M[k]
        body = parent.add_body(name=name, pos=[at, 0, 0])
        # The caps of the capsules overlap at the joints.
        body.add_geom(
            name=name,
            type=capsule,
            size=[radius, 0, 0],
            fromto=[0, 0, 0, length - (radius if k == len(PHALANGES) - 1 else 0.0), 0, 0],
            density=TISSUE_DENSITY,
            rgba=_SKIN,
        )
        for j in (j for j, (moved, _) in enumerate(_HINGES) if moved == k):
            stiffness = parameters.joint_stiffness[j]
            farther = max(abs(JOINT_RANGE[j] - JOINT_REST[j]))
            # At the end of the range, the torque k x + c x³ has the stiffness END_STIFFNESS k.
            rise = (END_STIFFNESS - 1.0) / (3.0 * farther**2)
            body.add_joint(
                name=JOINTS[j],
                type=mujoco.mjtJoint.mjJNT_HINGE,
                axis=_HINGES[j][1],
                range=np.degrees(JOINT_RANGE[j]),
                stiffness=[stiffness, 0.0, stiffness * rise],
                springref=math.degrees(JOINT_REST[j]),
                damping=[parameters.joint_damping[j], 0.0, 0.0],
                frictionloss=parameters.joint_friction[j],
                solref_limit=_LIMIT,
                solimp_limit=_LIMIT_IMPEDANCE,
            )
        parent, at = body, length
    parent.add_site(name=FINGERTIP, pos=[at, 0, 0], size=[0.001, 0, 0])


def _add_path(spec: mujoco.MjSpec, name: str, arms: tuple[float, ...]) -> mujoco.MjsTendon:
    """Add a tendon whose length is minus the sum of joint angles times moment arms."""
    path = spec.add_tendon(name=name)
    for joint, arm in zip(JOINTS, arms, strict=True):
        path.wrap_joint(joint, -arm)
    return path


def _add_tendon(
    spec: mujoco.MjSpec, i: int, parameters: FingerParameters, drive: TendonDrive
) -> None:
    """Add a tendon with its motor, which pulls it directly or, if it stretches, by a spring."""
    name, arms = TENDONS[i], parameters.moment_arms[i]
    path = _add_path(spec, name, arms)
    if parameters.tendon_stiffness is None:
        path.armature = parameters.motor_kg
        path.damping = [parameters.tendon_damping, 0.0, 0.0]
        path.frictionloss = parameters.tendon_friction
        transmission, target, sign = mujoco.mjtTrn.mjTRN_TENDON, name, -1.0
    else:
        # The motor is a sliding mass.
        transmission, target, sign = mujoco.mjtTrn.mjTRN_JOINT, f"{name}/motor", 1.0
        spool = spec.worldbody.add_body(
            name=target,
            mass=parameters.motor_kg,
            inertia=[1e-9] * 3,
            gravcomp=1.0,
            explicitinertial=True,
        )
        spool.add_joint(
            name=target,
            type=mujoco.mjtJoint.mjJNT_SLIDE,
            axis=[1, 0, 0],
            damping=[parameters.tendon_damping, 0.0, 0.0],
            frictionloss=parameters.tendon_friction,
        )
        # This tendon is the spring between motor and finger; its length is the stretch.
        cable = _add_path(spec, f"{name}/stretch", arms)
        cable.wrap_joint(target, 1.0)
        cable.stiffness = [parameters.tendon_stiffness, 0.0, 0.0]
        # The spring only pulls; it is slack if the stretch is below the backlash.
        cable.springlength = [-1e3, parameters.backlash]
        critical = 2.0 * math.sqrt(parameters.tendon_stiffness * parameters.motor_kg)
        cable.damping = [_CABLE_DAMPING_RATIO * critical, 0.0, 0.0]
    motor = spec.add_actuator(
        name=name,
        trntype=transmission,
        target=target,
        ctrllimited=True,
        ctrlrange=[-1.0, 1.0],
        forcelimited=True,
        # A pulling force has the sign `sign`.
        forcerange=sorted((sign * parameters.least_tension, sign * parameters.most_tension[i])),
        dyntype=mujoco.mjtDyn.mjDYN_FILTEREXACT,
        gaintype=mujoco.mjtGain.mjGAIN_AFFINE,
        biastype=mujoco.mjtBias.mjBIAS_AFFINE,
    )
    motor.dynprm[0] = parameters.motor_lag
    # A pull is negative at a tendon, and positive at a motor, whose travel shortens the tendon.
    rest = 1.0 - drive.muscle_stiffness * drive.rest[i]
    muscle = np.array([sign * rest, -drive.muscle_stiffness, -drive.muscle_damping])
    motor.gainprm[:3] = drive.gain[i] * muscle
    motor.biasprm[:3] = drive.offset[i] * muscle - (0.0, drive.stiffness, drive.damping)
    if parameters.command_delay > 0.0:
        motor.delay = parameters.command_delay
        kept = max(parameters.command_delay, _KEPT_S)
        motor.nsample = 1 + math.ceil(kept / spec.option.timestep)


class FingerFigure:
    """Visual model of a finger with its anatomy, posed from outside and never simulated.

    One figure can show any finger, because fingers do not differ visibly.
    """

    def __init__(self) -> None:
        spec = build_finger(NOMINAL, drive_of("tension", NOMINAL), anatomy=True)
        self.model: mujoco.MjModel = spec.compile()
        self.data = mujoco.MjData(self.model)
        self._mark = self.model.body(TARGET).mocapid[0]
        self._courses = [
            [self.model.tendon(course).id for course in route_names(name)] for name in TENDONS
        ]

    def show(
        self, angles: NDArray[np.float64], pulled: NDArray[np.float64], target: NDArray[np.float64]
    ) -> None:
        """Set joint angles, rad, (4,), and the target of the fingertip, m, (3,).

        `pulled` are tensions divided by the largest tensions, (7,); they set the tendons' widths.
        """
        widths = THINNEST_M + (THICKEST_M - THINNEST_M) * pulled.clip(0.0, 1.0)
        for courses, width in zip(self._courses, widths, strict=True):
            self.model.tendon_width[courses] = width
        self.data.qpos[:] = angles
        self.data.mocap_pos[self._mark] = target
        mujoco.mj_forward(self.model, self.data)


_UNITS: Final[Mapping[str, str]] = {
    "moment_arms": f"m, for each of {', '.join(TENDONS)}: {', '.join(JOINTS)}",
    "most_tension": "N",
    "least_tension": "N",
    "joint_stiffness": "N·m/rad",
    "joint_damping": "N·m·s/rad",
    "joint_friction": "N·m",
    "tendon_damping": "N·s/m",
    "tendon_friction": "N",
    "tendon_stiffness": "N/m",
    "backlash": "m",
    "motor_kg": "kg",
    "motor_lag": "s",
    "command_delay": "s",
    "joint_noise": "rad",
    "tension_noise": "N",
    "control_hz": "1/s",
    "tick_hz": "1/s",
    "slew_per_s": "ranges per second",
    "slew_down_per_s": "ranges per second",
    "tension_step": "N",
}
# Attributes of MJCF elements, and the arrays of the compiled model with their exact values. All
# joints have one degree of freedom.
_EXACT: Final[Mapping[str, Mapping[str, str]]] = {
    "joint": {
        "range": "jnt_range",
        "damping": "dof_damping",
        "frictionloss": "dof_frictionloss",
        "springref": "qpos_spring",
    },
    "geom": {"size": "geom_size", "pos": "geom_pos", "quat": "geom_quat"},
    "site": {"pos": "site_pos"},
    "body": {"pos": "body_pos"},
    "fixed": {
        "stiffness": "tendon_stiffness",
        "damping": "tendon_damping",
        "frictionloss": "tendon_frictionloss",
        "armature": "tendon_armature",
        "springlength": "tendon_lengthspring",
    },
    "general": {
        "delay": "actuator_delay",
        "forcerange": "actuator_forcerange",
        "dynprm": "actuator_dynprm",
        "gainprm": "actuator_gainprm",
        "biasprm": "actuator_biasprm",
    },
}


def finger_mjcf(parameters: FingerParameters, drive: TendonDrive) -> str:
    """Return the MJCF of a finger with its anatomy; a comment lists what it does not simulate.

    Controls are the commands of the drive, or tensions if the parameters have a command path.
    """
    spec = build_finger(parameters, drive, anatomy=True)
    model: Any = spec.compile()
    # MuJoCo writes six digits, and leaves out the inertia of bodies without geoms.
    root = ElementTree.fromstring(spec.to_xml())
    for tag, exact in _EXACT.items():
        find = getattr(model, {"fixed": "tendon", "general": "actuator"}.get(tag, tag))
        for element in [one for one in root.iter(tag) if one.get("name")]:
            number = find(element.get("name")).id
            for key, array in exact.items():
                if key in element.attrib:
                    many = len(element.attrib[key].split())
                    element.set(key, _text(np.ravel(getattr(model, array)[number])[:many]))
            if tag == "joint" and "stiffness" in element.attrib:
                rise = model.jnt_stiffnesspoly[number]
                element.set("stiffness", _text([model.jnt_stiffness[number], *rise]))
            elif tag == "body" and element.get("name", "").endswith("/motor"):
                inertial = ElementTree.Element("inertial", pos="0 0 0")
                inertial.set("mass", _text(model.body_mass[number]))
                inertial.set("diaginertia", _text(model.body_inertia[number]))
                element.insert(0, inertial)
            elif tag == "fixed":
                for i, wrapped in enumerate(element):
                    wrapped.set("coef", _text(model.wrap_prm[model.tendon_adr[number] + i]))
    root.insert(0, ElementTree.Comment(_limits(parameters)))
    root.append(_custom(parameters))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _text(value: Any) -> str:
    return " ".join(repr(float(number)) for number in np.ravel(value))


def _custom(parameters: FingerParameters) -> ElementTree.Element:
    """Return a `custom` element with each parameter as a `numeric`, and its unit as a `text`."""
    custom = ElementTree.Element("custom")
    values = msgspec.structs.asdict(parameters)
    path = values.pop("path")
    if path is not None:
        values |= msgspec.structs.asdict(path)
    for name, value in values.items():
        if value is not None:
            ElementTree.SubElement(custom, "numeric", name=name, data=_text(value))
            ElementTree.SubElement(custom, "text", name=f"{name}/unit", data=_UNITS[name])
    return custom


def _limits(parameters: FingerParameters) -> str:
    """List the effects that the file does not simulate, for the comment at its top."""
    comments = [
        "A finger of Shapechanger. Controls are -1 to 1 in the order of the actuators.",
        f"Not simulated by this file: noise of the joints ({parameters.joint_noise:g} rad) and of "
        f"the tensions ({parameters.tension_noise:g} N).",
    ]
    path = parameters.path
    if path is not None:
        slews = [f"{v:g}" if v else "unlimited" for v in (path.slew_per_s, path.slew_down_per_s)]
        comments.append(
            f"Not simulated either: tensions are computed at {path.control_hz:g} Hz, sent at "
            f"{path.tick_hz:g} Hz, with a slew of {slews[0]} up and {slews[1]} down, in ranges per "
            f"second, and steps of {path.tension_step:g} N. The controls are tensions from the "
            "least to the most."
        )
    delay = f"{1e3 * parameters.command_delay:g} ms"
    comments.append(f"The actuators delay commands by {delay} (needs MuJoCo 4).")
    return " " + "\n  ".join(comments) + " "
