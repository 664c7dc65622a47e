import typing

import numpy

from mujoco import _specs
from mujoco._callbacks import *
from mujoco._constants import *
from mujoco._enums import *
from mujoco._functions import *
from mujoco._render import *
from mujoco._specs import *
from mujoco._structs import *
from mujoco.rendering.classic.gl_context import GLContext as GLContext
from mujoco.rendering.classic.renderer import Renderer as Renderer

__version__: str
HEADERS_DIR: str
PLUGINS_DIR: str
PLUGIN_HANDLES: list[typing.Any]
MJTNUM_DTYPE: type[numpy.float64]

MjStruct: typing.TypeAlias = (
    _specs.MjsActuator
    | _specs.MjsBody
    | _specs.MjsCamera
    | _specs.MjsEquality
    | _specs.MjsExclude
    | _specs.MjsFlex
    | _specs.MjsFrame
    | _specs.MjsGeom
    | _specs.MjsHField
    | _specs.MjsJoint
    | _specs.MjsKey
    | _specs.MjsLight
    | _specs.MjsMaterial
    | _specs.MjsMesh
    | _specs.MjsNumeric
    | _specs.MjsPair
    | _specs.MjsPlugin
    | _specs.MjsSensor
    | _specs.MjsSite
    | _specs.MjsSkin
    | _specs.MjsTendon
    | _specs.MjsText
    | _specs.MjsTexture
    | _specs.MjsTuple
)

def to_zip(spec: _specs.MjSpec, file: str | typing.IO[bytes]) -> None: ...
def from_zip(file: str | typing.IO[bytes]) -> _specs.MjSpec: ...

class FatalError(Exception): ...
class UnexpectedError(Exception): ...
