"""Everything in a compiled model that decides no motion, and that an env or a task may still read.

An effective model holds what decides the motion. A task may also read a sensor, the place of a site
or of a geom that touches nothing, or a custom number; a start may be a keyframe; and where frames
are observed, colours, lights and cameras count.
"""

from __future__ import annotations

import mujoco
import numpy as np

from shapechanger.morphology.effective import bodies
from shapechanger.morphology.effective.elements import Names, Rows, Section, names_of, words
from shapechanger.morphology.effective.model import EffectiveModel

_OBJ = mujoco.mjtObj
# Arrays that frames are drawn from, besides the places of geoms and sites.
_DRAWN = (
    *("geom_rgba", "geom_matid", "site_rgba", "site_matid", "skin_rgba", "mat_rgba", "mat_texid"),
    *("mat_texrepeat", "mat_texuniform", "mat_emission", "mat_specular", "mat_shininess"),
    *("mat_reflectance", "tex_type", "tex_height", "tex_width", "tex_nchannel", "tex_data"),
    *("light_pos", "light_dir", "light_diffuse", "light_ambient", "light_specular"),
    *("light_castshadow", "light_active", "light_type", "skin_vert", "skin_face", "tendon_rgba"),
    *("tendon_width", "mesh_texcoord", "mesh_normal"),
)


def sensed_model(model: mujoco.MjModel, *, drawn: bool) -> EffectiveModel:
    """Extract what may be read of a compiled model besides its motion.

    The sections are `places` of geoms, `marks` (sites), `sensors`, `keyframes`, `custom` numbers
    and, if frames are seen, `cameras` and `drawing`.

    Args:
        model: The compiled model.
        drawn: Whether frames are observed.
    """
    names = names_of(model)
    sections = [
        ("places", bodies.geoms(model, names, np.ones(model.ngeom, np.bool_))),
        ("marks", bodies.sites(model, names, np.ones(model.nsite, np.bool_))),
        ("sensors", _sensors(model)),
        ("keyframes", _keyframes(model)),
        ("custom", _custom(model)),
    ]
    if drawn:
        sections += [("cameras", _cameras(model, names)), ("drawing", _drawing(model))]
    return EffectiveModel(tuple(sections))


def _given(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """Return the names of all elements of a kind, numbered where there is none."""
    word = kind.name.removeprefix("mjOBJ_").lower()
    return [mujoco.mj_id2name(model, kind, i) or f"{word} {i}" for i in range(count)]


def _sensors(model: mujoco.MjModel) -> Section:
    rows = Rows(_given(model, _OBJ.mjOBJ_SENSOR, model.nsensor))
    rows.words("type", words(mujoco.mjtSensor, model.sensor_type))
    rows.words("object", _objects(model, model.sensor_objtype, model.sensor_objid))
    rows.words("reference", _objects(model, model.sensor_reftype, model.sensor_refid))
    rows.numbers("dimension", model.sensor_dim)
    rows.numbers("cutoff", model.sensor_cutoff)
    rows.numbers("noise", model.sensor_noise)
    return rows.section(in_order=True)


def _objects(model: mujoco.MjModel, kinds: object, ids: object) -> list[str]:
    """Return the names of elements of several kinds; the number of one without a name."""
    pairs = zip(np.asarray(kinds).tolist(), np.asarray(ids).tolist(), strict=True)
    return [
        "" if number < 0 else mujoco.mj_id2name(model, kind, number) or f"{kind} {number}"
        for kind, number in pairs
    ]


def _keyframes(model: mujoco.MjModel) -> Section:
    rows = Rows(_given(model, _OBJ.mjOBJ_KEY, model.nkey))
    for name in ("time", "qpos", "qvel", "act", "ctrl", "mpos", "mquat"):
        rows.numbers(name, getattr(model, f"key_{name}"))
    return rows.section(in_order=True)


def _custom(model: mujoco.MjModel) -> Section:
    rows = Rows(_given(model, _OBJ.mjOBJ_NUMERIC, model.nnumeric))
    adr, size = model.numeric_adr.tolist(), model.numeric_size.tolist()
    rows.parts("value", model.numeric_data, adr, size)
    return rows.section()


def _cameras(model: mujoco.MjModel, names: Names) -> Section:
    rows = Rows(_given(model, _OBJ.mjOBJ_CAMERA, model.ncam))
    rows.words("body", [names.bodies[int(body)] for body in model.cam_bodyid])
    for name in ("pos", "quat", "fovy", "sensorsize", "intrinsic"):
        rows.numbers(name, getattr(model, f"cam_{name}"))
    return rows.section()


def _drawing(model: mujoco.MjModel) -> Section:
    arrays = {name: getattr(model, name) for name in _DRAWN}
    return tuple((name, (("digest", (bodies.digest(values),)),)) for name, values in arrays.items())
