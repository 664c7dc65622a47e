"""The finger as an MJCF file that plain MuJoCo loads."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final
from xml.etree import ElementTree

import msgspec
import numpy as np

from shapechanger.finger.anatomy import JOINTS, TENDONS
from shapechanger.finger.model import build_finger
from shapechanger.finger.parameters import FingerParameters
from shapechanger.finger.tensions import TendonDrive

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
# Attributes of MJCF elements with the arrays of the compiled model that hold them exactly. All
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
    """Return the MJCF of a finger with its anatomy, parameters and, as a comment, its limits.

    Controls are the commands of the drive; with a path, they are tensions.
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
    """Return the parameters as numbers, each with a text for its unit."""
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
            f"Nor the path of a command: tensions are computed at {path.control_hz:g} Hz, sent at "
            f"{path.tick_hz:g} Hz, with a slew of {slews[0]} up and {slews[1]} down, in ranges per "
            f"second, and steps of {path.tension_step:g} N. The controls are tensions from the "
            "least to the most."
        )
    delay = f"{1e3 * parameters.command_delay:g} ms"
    comments.append(f"The delay of the commands, {delay}, is the actuators' (MuJoCo 4).")
    return " " + "\n  ".join(comments) + " "
