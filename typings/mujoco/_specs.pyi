import builtins
import collections.abc
import typing
import numpy.typing
import mujoco._specs
import collections.abc
import mujoco._enums
import mujoco._structs
import numpy
import numpy.typing
import typing
__all__: list[str] = ['MjByteVec', 'MjCharVec', 'MjDoubleVec', 'MjFloatVec', 'MjIntVec', 'MjOption', 'MjSpec', 'MjStatistic', 'MjStringVec', 'MjVfs', 'MjVisual', 'MjVisualHeadlight', 'MjVisualRgba', 'MjsActuator', 'MjsAuthored', 'MjsBody', 'MjsCamera', 'MjsCompiler', 'MjsDefault', 'MjsElement', 'MjsEquality', 'MjsExclude', 'MjsFlex', 'MjsFrame', 'MjsGeom', 'MjsHField', 'MjsJoint', 'MjsKey', 'MjsLight', 'MjsMaterial', 'MjsMesh', 'MjsNumeric', 'MjsOrientation', 'MjsPair', 'MjsPlugin', 'MjsSensor', 'MjsSite', 'MjsSkin', 'MjsTendon', 'MjsTendonPath', 'MjsText', 'MjsTexture', 'MjsTuple', 'MjsWrap']

class MjSpec:
    assets: dict[str, bytes]
    authored: MjsAuthored
    comment: str
    compiler: MjsCompiler
    hasImplicitPluginElem: bool
    meshdir: str
    modelfiledir: str
    modelname: str
    option: MjOption
    override_assets: bool
    stat: MjStatistic
    strippath: bool
    texturedir: str
    visual: MjVisual

    @staticmethod
    def from_file(filename: str, include: collections.abc.Mapping[str, bytes] | None=None, assets: dict[str, typing.Any] | None=None, vfs: MjVfs | None=None) -> MjSpec:
        ...

    @staticmethod
    def from_string(xml: str, include: collections.abc.Mapping[str, bytes] | None=None, assets: dict[str, typing.Any] | None=None, vfs: MjVfs | None=None) -> MjSpec:
        ...

    @staticmethod
    def from_zip(file: str | typing.IO[bytes]) -> MjSpec:
        ...

    @staticmethod
    def resolve_orientation(degree: bool, sequence: MjCharVec | None=None, *, orientation: MjsOrientation) -> list[float]:
        ...

    def to_zip(self, file: str | typing.IO[bytes]) -> None:
        ...

    def __init__(self) -> None:
        ...

    def activate_plugin(self, name: str) -> None:
        ...

    def actuator(self, arg0: str) -> MjsActuator | typing.Any:
        ...

    def add_actuator(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, gaintype: typing.SupportsInt | typing.SupportsIndex | None=None, gainprm: numpy.typing.ArrayLike | None=None, biastype: typing.SupportsInt | typing.SupportsIndex | None=None, biasprm: numpy.typing.ArrayLike | None=None, dyntype: typing.SupportsInt | typing.SupportsIndex | None=None, dynprm: numpy.typing.ArrayLike | None=None, actdim: typing.SupportsInt | typing.SupportsIndex | None=None, ctrlspec: typing.SupportsInt | typing.SupportsIndex | None=None, velrange: numpy.typing.ArrayLike | None=None, ffrange: numpy.typing.ArrayLike | None=None, actearly: typing.SupportsInt | typing.SupportsIndex | None=None, trntype: typing.SupportsInt | typing.SupportsIndex | None=None, gear: numpy.typing.ArrayLike | None=None, target: str | None=None, refsite: str | None=None, slidersite: str | None=None, cranklength: typing.SupportsFloat | typing.SupportsIndex | None=None, lengthrange: numpy.typing.ArrayLike | None=None, inheritrange: typing.SupportsFloat | typing.SupportsIndex | None=None, damping: typing.Any | None=None, armature: typing.SupportsFloat | typing.SupportsIndex | None=None, ctrllimited: typing.SupportsInt | typing.SupportsIndex | None=None, ctrlrange: numpy.typing.ArrayLike | None=None, forcelimited: typing.SupportsInt | typing.SupportsIndex | None=None, forcerange: numpy.typing.ArrayLike | None=None, actlimited: typing.SupportsInt | typing.SupportsIndex | None=None, actrange: numpy.typing.ArrayLike | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, nsample: typing.SupportsInt | typing.SupportsIndex | None=None, interp: typing.SupportsInt | typing.SupportsIndex | None=None, delay: typing.SupportsFloat | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, plugin: MjsPlugin | None=None, info: str | None=None) -> MjsActuator:
        ...

    def add_default(self, arg0: str, arg1: MjsDefault) -> MjsDefault:
        ...

    def add_equality(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, data: numpy.typing.ArrayLike | None=None, active: typing.SupportsInt | typing.SupportsIndex | None=None, name1: str | None=None, name2: str | None=None, objtype: typing.SupportsInt | typing.SupportsIndex | None=None, solref: numpy.typing.ArrayLike | None=None, solimp: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsEquality:
        ...

    def add_exclude(self, name: str | None=None, bodyname1: str | None=None, bodyname2: str | None=None, info: str | None=None) -> MjsExclude:
        ...

    def add_flex(self, name: str | None=None, contype: typing.SupportsInt | typing.SupportsIndex | None=None, conaffinity: typing.SupportsInt | typing.SupportsIndex | None=None, condim: typing.SupportsInt | typing.SupportsIndex | None=None, priority: typing.SupportsInt | typing.SupportsIndex | None=None, friction: numpy.typing.ArrayLike | None=None, solmix: typing.SupportsFloat | typing.SupportsIndex | None=None, solref: numpy.typing.ArrayLike | None=None, solimp: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, gap: typing.SupportsFloat | typing.SupportsIndex | None=None, dim: typing.SupportsInt | typing.SupportsIndex | None=None, radius: typing.SupportsFloat | typing.SupportsIndex | None=None, size: typing.Any | None=None, flatskin: typing.SupportsInt | typing.SupportsIndex | None=None, selfcollide: typing.SupportsInt | typing.SupportsIndex | None=None, passive: typing.SupportsInt | typing.SupportsIndex | None=None, activelayers: typing.SupportsInt | typing.SupportsIndex | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, edgestiffness: typing.SupportsFloat | typing.SupportsIndex | None=None, edgedamping: typing.SupportsFloat | typing.SupportsIndex | None=None, rgba: numpy.typing.ArrayLike | None=None, material: collections.abc.Sequence[str] | None=None, young: typing.SupportsFloat | typing.SupportsIndex | None=None, poisson: typing.SupportsFloat | typing.SupportsIndex | None=None, shear: typing.SupportsFloat | typing.SupportsIndex | None=None, damping: typing.SupportsFloat | typing.SupportsIndex | None=None, thickness: typing.SupportsFloat | typing.SupportsIndex | None=None, stressyield: numpy.typing.ArrayLike | None=None, elastic2d: typing.SupportsInt | typing.SupportsIndex | None=None, elastic3d: typing.SupportsInt | typing.SupportsIndex | None=None, section: typing.SupportsInt | typing.SupportsIndex | None=None, sectionsize: numpy.typing.ArrayLike | None=None, cellcount: numpy.typing.ArrayLike | None=None, order: typing.SupportsInt | typing.SupportsIndex | None=None, nodebody: collections.abc.Sequence[str] | None=None, vertbody: collections.abc.Sequence[str] | None=None, node: numpy.typing.ArrayLike | None=None, vert: numpy.typing.ArrayLike | None=None, elem: numpy.typing.ArrayLike | None=None, texcoord: numpy.typing.ArrayLike | None=None, elemtexcoord: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsFlex:
        ...

    def add_hfield(self, name: str | None=None, content_type: str | None=None, file: str | None=None, size: numpy.typing.ArrayLike | None=None, nrow: typing.SupportsInt | typing.SupportsIndex | None=None, ncol: typing.SupportsInt | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsHField:
        ...

    def add_key(self, name: str | None=None, time: typing.SupportsFloat | typing.SupportsIndex | None=None, qpos: numpy.typing.ArrayLike | None=None, qvel: numpy.typing.ArrayLike | None=None, act: numpy.typing.ArrayLike | None=None, mpos: numpy.typing.ArrayLike | None=None, mquat: numpy.typing.ArrayLike | None=None, ctrl: numpy.typing.ArrayLike | None=None, plastic: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsKey:
        ...

    def add_material(self, default: MjsDefault | None=None, name: str | None=None, textures: collections.abc.Sequence[str] | None=None, texuniform: typing.SupportsInt | typing.SupportsIndex | None=None, texrepeat: numpy.typing.ArrayLike | None=None, emission: typing.SupportsFloat | typing.SupportsIndex | None=None, specular: typing.SupportsFloat | typing.SupportsIndex | None=None, shininess: typing.SupportsFloat | typing.SupportsIndex | None=None, reflectance: typing.SupportsFloat | typing.SupportsIndex | None=None, metallic: typing.SupportsFloat | typing.SupportsIndex | None=None, roughness: typing.SupportsFloat | typing.SupportsIndex | None=None, rgba: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsMaterial:
        ...

    def add_mesh(self, default: MjsDefault | None=None, name: str | None=None, content_type: str | None=None, file: str | None=None, refpos: numpy.typing.ArrayLike | None=None, refquat: numpy.typing.ArrayLike | None=None, scale: numpy.typing.ArrayLike | None=None, inertia: typing.SupportsInt | typing.SupportsIndex | None=None, smoothnormal: typing.SupportsInt | typing.SupportsIndex | None=None, needsdf: typing.SupportsInt | typing.SupportsIndex | None=None, maxhullvert: typing.SupportsInt | typing.SupportsIndex | None=None, uservert: numpy.typing.ArrayLike | None=None, usernormal: numpy.typing.ArrayLike | None=None, usertexcoord: numpy.typing.ArrayLike | None=None, userface: numpy.typing.ArrayLike | None=None, userfacenormal: numpy.typing.ArrayLike | None=None, userfacetexcoord: numpy.typing.ArrayLike | None=None, usernode: numpy.typing.ArrayLike | None=None, usertet: numpy.typing.ArrayLike | None=None, plugin: MjsPlugin | None=None, material: str | None=None, octree_maxdepth: typing.SupportsInt | typing.SupportsIndex | None=None, info: str | None=None) -> MjsMesh:
        ...

    def add_numeric(self, name: str | None=None, data: numpy.typing.ArrayLike | None=None, size: typing.SupportsInt | typing.SupportsIndex | None=None, info: str | None=None) -> MjsNumeric:
        ...

    def add_pair(self, default: MjsDefault | None=None, name: str | None=None, geomname1: str | None=None, geomname2: str | None=None, condim: typing.SupportsInt | typing.SupportsIndex | None=None, solref: numpy.typing.ArrayLike | None=None, solreffriction: numpy.typing.ArrayLike | None=None, solimp: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, gap: typing.SupportsFloat | typing.SupportsIndex | None=None, adhesion: typing.SupportsFloat | typing.SupportsIndex | None=None, friction: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsPair:
        ...

    def add_plugin(self, name: str | None=None, plugin_name: str | None=None, active: typing.SupportsInt | typing.SupportsIndex | None=None, info: str | None=None) -> MjsPlugin:
        ...

    def add_sensor(self, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, objtype: typing.SupportsInt | typing.SupportsIndex | None=None, objname: str | None=None, reftype: typing.SupportsInt | typing.SupportsIndex | None=None, refname: str | None=None, intprm: numpy.typing.ArrayLike | None=None, datatype: typing.SupportsInt | typing.SupportsIndex | None=None, needstage: typing.SupportsInt | typing.SupportsIndex | None=None, dim: typing.SupportsInt | typing.SupportsIndex | None=None, cutoff: typing.SupportsFloat | typing.SupportsIndex | None=None, noise: typing.SupportsFloat | typing.SupportsIndex | None=None, nsample: typing.SupportsInt | typing.SupportsIndex | None=None, interp: typing.SupportsInt | typing.SupportsIndex | None=None, delay: typing.SupportsFloat | typing.SupportsIndex | None=None, interval: numpy.typing.ArrayLike | None=None, userdata: numpy.typing.ArrayLike | None=None, plugin: MjsPlugin | None=None, info: str | None=None) -> MjsSensor:
        ...

    def add_skin(self, name: str | None=None, file: str | None=None, material: str | None=None, rgba: numpy.typing.ArrayLike | None=None, inflate: typing.SupportsFloat | typing.SupportsIndex | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, vert: numpy.typing.ArrayLike | None=None, texcoord: numpy.typing.ArrayLike | None=None, face: numpy.typing.ArrayLike | None=None, bodyname: collections.abc.Sequence[str] | None=None, bindpos: numpy.typing.ArrayLike | None=None, bindquat: numpy.typing.ArrayLike | None=None, vertid: collections.abc.Sequence[numpy.typing.ArrayLike] | None=None, vertweight: collections.abc.Sequence[numpy.typing.ArrayLike] | None=None, info: str | None=None) -> MjsSkin:
        ...

    def add_tendon(self, default: MjsDefault | None=None, name: str | None=None, stiffness: typing.Any | None=None, springlength: numpy.typing.ArrayLike | None=None, springyield: typing.SupportsFloat | typing.SupportsIndex | None=None, damping: typing.Any | None=None, frictionloss: typing.SupportsFloat | typing.SupportsIndex | None=None, solref_friction: numpy.typing.ArrayLike | None=None, solimp_friction: numpy.typing.ArrayLike | None=None, armature: typing.SupportsFloat | typing.SupportsIndex | None=None, limited: typing.SupportsInt | typing.SupportsIndex | None=None, actfrclimited: typing.SupportsInt | typing.SupportsIndex | None=None, range: numpy.typing.ArrayLike | None=None, actfrcrange: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, solref_limit: numpy.typing.ArrayLike | None=None, solimp_limit: numpy.typing.ArrayLike | None=None, material: str | None=None, width: typing.SupportsFloat | typing.SupportsIndex | None=None, rgba: numpy.typing.ArrayLike | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsTendon:
        ...

    def add_text(self, name: str | None=None, data: str | None=None, info: str | None=None) -> MjsText:
        ...

    def add_texture(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, colorspace: typing.SupportsInt | typing.SupportsIndex | None=None, builtin: typing.SupportsInt | typing.SupportsIndex | None=None, mark: typing.SupportsInt | typing.SupportsIndex | None=None, rgb1: numpy.typing.ArrayLike | None=None, rgb2: numpy.typing.ArrayLike | None=None, markrgb: numpy.typing.ArrayLike | None=None, random: typing.SupportsFloat | typing.SupportsIndex | None=None, height: typing.SupportsInt | typing.SupportsIndex | None=None, width: typing.SupportsInt | typing.SupportsIndex | None=None, nchannel: typing.SupportsInt | typing.SupportsIndex | None=None, content_type: str | None=None, file: str | None=None, gridsize: numpy.typing.ArrayLike | None=None, gridlayout: typing.Any=None, cubefiles: collections.abc.Sequence[str] | None=None, data: numpy.typing.ArrayLike | None=None, hflip: typing.SupportsInt | typing.SupportsIndex | None=None, vflip: typing.SupportsInt | typing.SupportsIndex | None=None, embed: typing.SupportsInt | typing.SupportsIndex | None=None, info: str | None=None) -> MjsTexture:
        ...

    def add_tuple(self, name: str | None=None, objtype: numpy.typing.ArrayLike | None=None, objname: collections.abc.Sequence[str] | None=None, objprm: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsTuple:
        ...

    def adopt_inertial(self, body: MjsBody, vfs: MjVfs | None=None) -> None:
        ...

    def attach(self, child: MjSpec, prefix: str | None=None, suffix: str | None=None, site: MjsSite | str | None=None, frame: MjsFrame | str | None=None) -> MjsFrame:
        ...

    def body(self, arg0: str) -> MjsBody | typing.Any:
        ...

    def camera(self, arg0: str) -> MjsCamera | typing.Any:
        ...

    def compile(self, vfs: MjVfs | None=None) -> mujoco._structs.MjModel:
        ...

    def copy(self) -> MjSpec:
        ...

    def copy_back(self, model: mujoco._structs.MjModel) -> None:
        ...

    def dedup_assets(self) -> int:
        ...

    @typing.overload
    def delete(self, arg0: MjsDefault) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsBody) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsFrame) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsGeom) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsJoint) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsSite) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsCamera) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsLight) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsMaterial) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsMesh) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsPair) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsEquality) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsActuator) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsTendon) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsSensor) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsFlex) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsHField) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsSkin) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsTexture) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsKey) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsText) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsNumeric) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsExclude) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsTuple) -> None:
        ...

    @typing.overload
    def delete(self, arg0: MjsPlugin) -> None:
        ...

    def discard_visual(self, vfs: MjVfs | None=None) -> int:
        ...

    def encode(self, filename: str, model: typing.Any | None=None, content_type: str | None=None) -> int:
        ...

    def equality(self, arg0: str) -> MjsEquality | typing.Any:
        ...

    def exclude(self, arg0: str) -> MjsExclude | typing.Any:
        ...

    def find_default(self, arg0: str) -> MjsDefault | typing.Any:
        ...

    def flex(self, arg0: str) -> MjsFlex | typing.Any:
        ...

    def frame(self, arg0: str) -> MjsFrame | typing.Any:
        ...

    def fuse_static(self, vfs: MjVfs | None=None) -> int:
        ...

    def geom(self, arg0: str) -> MjsGeom | typing.Any:
        ...

    def hfield(self, arg0: str) -> MjsHField | typing.Any:
        ...

    def joint(self, arg0: str) -> MjsJoint | typing.Any:
        ...

    def key(self, arg0: str) -> MjsKey | typing.Any:
        ...

    def light(self, arg0: str) -> MjsLight | typing.Any:
        ...

    def material(self, arg0: str) -> MjsMaterial | typing.Any:
        ...

    def mesh(self, arg0: str) -> MjsMesh | typing.Any:
        ...

    def numeric(self, arg0: str) -> MjsNumeric | typing.Any:
        ...

    def pair(self, arg0: str) -> MjsPair | typing.Any:
        ...

    def plugin(self, arg0: str) -> MjsPlugin | typing.Any:
        ...

    def recompile(self, m: mujoco._structs.MjModel, d: mujoco._structs.MjData, vfs: MjVfs | None=None) -> tuple[mujoco._structs.MjModel, mujoco._structs.MjData]:
        ...

    def sensor(self, arg0: str) -> MjsSensor | typing.Any:
        ...

    def site(self, arg0: str) -> MjsSite | typing.Any:
        ...

    def skin(self, arg0: str) -> MjsSkin | typing.Any:
        ...

    def tendon(self, arg0: str) -> MjsTendon | typing.Any:
        ...

    def text(self, arg0: str) -> MjsText | typing.Any:
        ...

    def texture(self, arg0: str) -> MjsTexture | typing.Any:
        ...

    def to_file(self, arg0: str) -> None:
        ...

    def to_xml(self) -> str:
        ...

    def tuple(self, arg0: str) -> MjsTuple | typing.Any:
        ...

    @property
    def _address(self) -> int:
        ...

    @property
    def actuators(self) -> list[MjsActuator]:
        ...

    @property
    def bodies(self) -> list[MjsBody]:
        ...

    @property
    def cameras(self) -> list[MjsCamera]:
        ...

    @property
    def copy_during_attach(self) -> None:
        ...

    @copy_during_attach.setter
    def copy_during_attach(self, arg1: bool) -> int:
        ...

    @property
    def default(self) -> MjsDefault:
        ...

    @property
    def equalities(self) -> list[MjsEquality]:
        ...

    @property
    def excludes(self) -> list[MjsExclude]:
        ...

    @property
    def flexes(self) -> list[MjsFlex]:
        ...

    @property
    def frames(self) -> list[MjsFrame]:
        ...

    @property
    def geoms(self) -> list[MjsGeom]:
        ...

    @property
    def hfields(self) -> list[MjsHField]:
        ...

    @property
    def joints(self) -> list[MjsJoint]:
        ...

    @property
    def keys(self) -> list[MjsKey]:
        ...

    @property
    def lights(self) -> list[MjsLight]:
        ...

    @property
    def materials(self) -> list[MjsMaterial]:
        ...

    @property
    def memory(self) -> int:
        ...

    @memory.setter
    def memory(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def meshes(self) -> list[MjsMesh]:
        ...

    @property
    def nconmax(self) -> int:
        ...

    @nconmax.setter
    def nconmax(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nemax(self) -> int:
        ...

    @nemax.setter
    def nemax(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def njmax(self) -> int:
        ...

    @njmax.setter
    def njmax(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nkey(self) -> int:
        ...

    @nkey.setter
    def nkey(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nstack(self) -> int:
        ...

    @nstack.setter
    def nstack(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def numerics(self) -> list[MjsNumeric]:
        ...

    @property
    def nuser_actuator(self) -> int:
        ...

    @nuser_actuator.setter
    def nuser_actuator(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_body(self) -> int:
        ...

    @nuser_body.setter
    def nuser_body(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_cam(self) -> int:
        ...

    @nuser_cam.setter
    def nuser_cam(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_geom(self) -> int:
        ...

    @nuser_geom.setter
    def nuser_geom(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_jnt(self) -> int:
        ...

    @nuser_jnt.setter
    def nuser_jnt(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_sensor(self) -> int:
        ...

    @nuser_sensor.setter
    def nuser_sensor(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_site(self) -> int:
        ...

    @nuser_site.setter
    def nuser_site(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuser_tendon(self) -> int:
        ...

    @nuser_tendon.setter
    def nuser_tendon(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nuserdata(self) -> int:
        ...

    @nuserdata.setter
    def nuserdata(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def pairs(self) -> list[MjsPair]:
        ...

    @property
    def parent(self) -> MjSpec:
        ...

    @property
    def plugins(self) -> list[MjsPlugin]:
        ...

    @property
    def sensors(self) -> list[MjsSensor]:
        ...

    @property
    def sites(self) -> list[MjsSite]:
        ...

    @property
    def skins(self) -> list[MjsSkin]:
        ...

    @property
    def tendons(self) -> list[MjsTendon]:
        ...

    @property
    def texts(self) -> list[MjsText]:
        ...

    @property
    def textures(self) -> list[MjsTexture]:
        ...

    @property
    def timer(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @property
    def tuples(self) -> list[MjsTuple]:
        ...

    @property
    def worldbody(self) -> MjsBody:
        ...

class MjsElement:
    pass

class MjsDefault:
    actuator: MjsActuator
    camera: MjsCamera
    equality: MjsEquality
    flex: MjsFlex
    geom: MjsGeom
    joint: MjsJoint
    light: MjsLight
    material: MjsMaterial
    mesh: MjsMesh
    name: str
    pair: MjsPair
    site: MjsSite
    tendon: MjsTendon
    texture: MjsTexture

class MjsBody:
    alt: MjsOrientation
    childclass: str
    classname: MjsDefault
    explicitinertial: bool
    ialt: MjsOrientation
    info: str
    mocap: bool
    name: str
    plugin: MjsPlugin

    def add_body(self, default: MjsDefault | None=None, name: str | None=None, childclass: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, mass: typing.SupportsFloat | typing.SupportsIndex | None=None, ipos: numpy.typing.ArrayLike | None=None, iquat: numpy.typing.ArrayLike | None=None, inertia: numpy.typing.ArrayLike | None=None, iaxisangle: numpy.typing.ArrayLike | None=None, ixyaxes: numpy.typing.ArrayLike | None=None, izaxis: numpy.typing.ArrayLike | None=None, ieuler: numpy.typing.ArrayLike | None=None, fullinertia: numpy.typing.ArrayLike | None=None, mocap: typing.SupportsInt | typing.SupportsIndex | None=None, gravcomp: typing.SupportsFloat | typing.SupportsIndex | None=None, sleep: typing.SupportsInt | typing.SupportsIndex | None=None, simple: typing.SupportsInt | typing.SupportsIndex | None=None, fuse: typing.SupportsInt | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, explicitinertial: typing.SupportsInt | typing.SupportsIndex | None=None, plugin: MjsPlugin | None=None, info: str | None=None) -> MjsBody:
        ...

    def add_camera(self, default: MjsDefault | None=None, name: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, mode: typing.SupportsInt | typing.SupportsIndex | None=None, targetbody: str | None=None, proj: typing.SupportsInt | typing.SupportsIndex | None=None, resolution: numpy.typing.ArrayLike | None=None, output: typing.SupportsInt | typing.SupportsIndex | None=None, fovy: typing.SupportsFloat | typing.SupportsIndex | None=None, ipd: typing.SupportsFloat | typing.SupportsIndex | None=None, intrinsic: numpy.typing.ArrayLike | None=None, sensor_size: numpy.typing.ArrayLike | None=None, focal_length: numpy.typing.ArrayLike | None=None, focal_pixel: numpy.typing.ArrayLike | None=None, principal_length: numpy.typing.ArrayLike | None=None, principal_pixel: numpy.typing.ArrayLike | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsCamera:
        ...

    def add_frame(self, default: MjsFrame | None=None, name: str | None=None, childclass: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, scale: typing.Any | None=None, scaling: typing.SupportsInt | typing.SupportsIndex | None=None, massscale: typing.SupportsFloat | typing.SupportsIndex | None=None, info: str | None=None) -> MjsFrame:
        ...

    def add_freejoint(self, **kwargs: typing.Any) -> MjsJoint:
        ...

    def add_geom(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, fromto: numpy.typing.ArrayLike | None=None, size: typing.Any | None=None, contype: typing.SupportsInt | typing.SupportsIndex | None=None, conaffinity: typing.SupportsInt | typing.SupportsIndex | None=None, condim: typing.SupportsInt | typing.SupportsIndex | None=None, priority: typing.SupportsInt | typing.SupportsIndex | None=None, friction: numpy.typing.ArrayLike | None=None, solmix: typing.SupportsFloat | typing.SupportsIndex | None=None, solref: numpy.typing.ArrayLike | None=None, solimp: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, gap: typing.SupportsFloat | typing.SupportsIndex | None=None, surfacevel: numpy.typing.ArrayLike | None=None, adhesion: typing.SupportsFloat | typing.SupportsIndex | None=None, mass: typing.SupportsFloat | typing.SupportsIndex | None=None, density: typing.SupportsFloat | typing.SupportsIndex | None=None, typeinertia: typing.SupportsInt | typing.SupportsIndex | None=None, fluid_ellipsoid: typing.SupportsInt | typing.SupportsIndex | None=None, fluid_coefs: numpy.typing.ArrayLike | None=None, material: str | None=None, rgba: numpy.typing.ArrayLike | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, castshadow: typing.SupportsInt | typing.SupportsIndex | None=None, hfieldname: str | None=None, meshname: str | None=None, fitscale: typing.SupportsFloat | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, plugin: MjsPlugin | None=None, info: str | None=None) -> MjsGeom:
        ...

    def add_joint(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, pos: numpy.typing.ArrayLike | None=None, axis: numpy.typing.ArrayLike | None=None, ref: typing.SupportsFloat | typing.SupportsIndex | None=None, align: typing.SupportsInt | typing.SupportsIndex | None=None, stiffness: typing.Any | None=None, springref: typing.SupportsFloat | typing.SupportsIndex | None=None, springyield: typing.SupportsFloat | typing.SupportsIndex | None=None, springdamper: numpy.typing.ArrayLike | None=None, limited: typing.SupportsInt | typing.SupportsIndex | None=None, range: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, solref_limit: numpy.typing.ArrayLike | None=None, solimp_limit: numpy.typing.ArrayLike | None=None, actfrclimited: typing.SupportsInt | typing.SupportsIndex | None=None, actfrcrange: numpy.typing.ArrayLike | None=None, armature: typing.SupportsFloat | typing.SupportsIndex | None=None, damping: typing.Any | None=None, frictionloss: typing.SupportsFloat | typing.SupportsIndex | None=None, solref_friction: numpy.typing.ArrayLike | None=None, solimp_friction: numpy.typing.ArrayLike | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, actgravcomp: typing.SupportsInt | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsJoint:
        ...

    def add_light(self, default: MjsDefault | None=None, name: str | None=None, pos: numpy.typing.ArrayLike | None=None, dir: numpy.typing.ArrayLike | None=None, mode: typing.SupportsInt | typing.SupportsIndex | None=None, targetbody: str | None=None, active: typing.SupportsInt | typing.SupportsIndex | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, texture: str | None=None, castshadow: typing.SupportsInt | typing.SupportsIndex | None=None, bulbradius: typing.SupportsFloat | typing.SupportsIndex | None=None, intensity: typing.SupportsFloat | typing.SupportsIndex | None=None, range: typing.SupportsFloat | typing.SupportsIndex | None=None, attenuation: numpy.typing.ArrayLike | None=None, cutoff: typing.SupportsFloat | typing.SupportsIndex | None=None, softness: typing.SupportsFloat | typing.SupportsIndex | None=None, exponent: typing.SupportsFloat | typing.SupportsIndex | None=None, ambient: numpy.typing.ArrayLike | None=None, diffuse: numpy.typing.ArrayLike | None=None, specular: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsLight:
        ...

    def add_site(self, default: MjsDefault | None=None, name: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, fromto: numpy.typing.ArrayLike | None=None, size: typing.Any | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, material: str | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, rgba: numpy.typing.ArrayLike | None=None, meshname: str | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsSite:
        ...

    def attach_frame(self, frame: MjsFrame, prefix: str | None=None, suffix: str | None=None) -> MjsFrame:
        ...

    @typing.overload
    def find_all(self, arg0: mujoco._enums.mjtObj) -> list[typing.Any]:
        ...

    @typing.overload
    def find_all(self, arg0: str) -> list[typing.Any]:
        ...

    def find_child(self, arg0: str) -> MjsBody | typing.Any:
        ...

    def first_body(self) -> MjsBody | typing.Any:
        ...

    def first_camera(self) -> MjsCamera | typing.Any:
        ...

    def first_frame(self) -> MjsFrame | typing.Any:
        ...

    def first_geom(self) -> MjsGeom | typing.Any:
        ...

    def first_joint(self) -> MjsJoint | typing.Any:
        ...

    def first_light(self) -> MjsLight | typing.Any:
        ...

    def first_site(self) -> MjsSite | typing.Any:
        ...

    def make_flex(self, name: str, type: str | None=None, dim: typing.SupportsInt | typing.SupportsIndex=3, dof: str | None=None, count: numpy.typing.ArrayLike | None=None, cellcount: numpy.typing.ArrayLike | None=None, spacing: numpy.typing.ArrayLike | None=None, scale: numpy.typing.ArrayLike | None=None, radius: typing.SupportsFloat | typing.SupportsIndex=0.0, mass: typing.SupportsFloat | typing.SupportsIndex=1.0, inertiabox: typing.SupportsFloat | typing.SupportsIndex=0.005, equality: typing.SupportsInt | typing.SupportsIndex=0, rigid: typing.SupportsInt | typing.SupportsIndex=0, flatskin: typing.SupportsInt | typing.SupportsIndex=0, elastic2d: typing.SupportsInt | typing.SupportsIndex=0, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, origin: numpy.typing.ArrayLike | None=None, file: str | None=None, mesh: str | None=None, vfs: MjVfs | None=None) -> MjsFlex:
        ...

    def next_body(self, arg0: MjsBody) -> MjsBody | typing.Any:
        ...

    def next_camera(self, arg0: MjsCamera) -> MjsCamera | typing.Any:
        ...

    def next_frame(self, arg0: MjsFrame) -> MjsFrame | typing.Any:
        ...

    def next_geom(self, arg0: MjsGeom) -> MjsGeom | typing.Any:
        ...

    def next_joint(self, arg0: MjsJoint) -> MjsJoint | typing.Any:
        ...

    def next_light(self, arg0: MjsLight) -> MjsLight | typing.Any:
        ...

    def next_site(self, arg0: MjsSite) -> MjsSite | typing.Any:
        ...

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    def to_frame(self) -> MjsFrame:
        ...

    @property
    def bodies(self) -> list[MjsBody]:
        ...

    @property
    def cameras(self) -> list[MjsCamera]:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def frames(self) -> list[MjsFrame]:
        ...

    @property
    def fullinertia(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @fullinertia.setter
    def fullinertia(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def fuse(self) -> int:
        ...

    @fuse.setter
    def fuse(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def geoms(self) -> list[MjsGeom]:
        ...

    @property
    def gravcomp(self) -> float:
        ...

    @gravcomp.setter
    def gravcomp(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def inertia(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @inertia.setter
    def inertia(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def ipos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @ipos.setter
    def ipos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def iquat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @iquat.setter
    def iquat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def joints(self) -> list[MjsJoint]:
        ...

    @property
    def lights(self) -> list[MjsLight]:
        ...

    @property
    def mass(self) -> float:
        ...

    @mass.setter
    def mass(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def quat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @quat.setter
    def quat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def simple(self) -> int:
        ...

    @simple.setter
    def simple(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def sites(self) -> list[MjsSite]:
        ...

    @property
    def sleep(self) -> mujoco._enums.mjtSleepPolicy:
        ...

    @sleep.setter
    def sleep(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsFrame:
    alt: MjsOrientation
    childclass: str
    info: str
    name: str

    def add_body(self, default: MjsDefault | None=None, name: str | None=None, childclass: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, mass: typing.SupportsFloat | typing.SupportsIndex | None=None, ipos: numpy.typing.ArrayLike | None=None, iquat: numpy.typing.ArrayLike | None=None, inertia: numpy.typing.ArrayLike | None=None, iaxisangle: numpy.typing.ArrayLike | None=None, ixyaxes: numpy.typing.ArrayLike | None=None, izaxis: numpy.typing.ArrayLike | None=None, ieuler: numpy.typing.ArrayLike | None=None, fullinertia: numpy.typing.ArrayLike | None=None, mocap: typing.SupportsInt | typing.SupportsIndex | None=None, gravcomp: typing.SupportsFloat | typing.SupportsIndex | None=None, sleep: typing.SupportsInt | typing.SupportsIndex | None=None, simple: typing.SupportsInt | typing.SupportsIndex | None=None, fuse: typing.SupportsInt | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, explicitinertial: typing.SupportsInt | typing.SupportsIndex | None=None, plugin: MjsPlugin | None=None, info: str | None=None) -> MjsBody:
        ...

    def add_camera(self, default: MjsDefault | None=None, name: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, mode: typing.SupportsInt | typing.SupportsIndex | None=None, targetbody: str | None=None, proj: typing.SupportsInt | typing.SupportsIndex | None=None, resolution: numpy.typing.ArrayLike | None=None, output: typing.SupportsInt | typing.SupportsIndex | None=None, fovy: typing.SupportsFloat | typing.SupportsIndex | None=None, ipd: typing.SupportsFloat | typing.SupportsIndex | None=None, intrinsic: numpy.typing.ArrayLike | None=None, sensor_size: numpy.typing.ArrayLike | None=None, focal_length: numpy.typing.ArrayLike | None=None, focal_pixel: numpy.typing.ArrayLike | None=None, principal_length: numpy.typing.ArrayLike | None=None, principal_pixel: numpy.typing.ArrayLike | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsCamera:
        ...

    def add_frame(self, default: MjsFrame | None=None, name: str | None=None, childclass: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, scale: typing.Any | None=None, scaling: typing.SupportsInt | typing.SupportsIndex | None=None, massscale: typing.SupportsFloat | typing.SupportsIndex | None=None, info: str | None=None) -> MjsFrame:
        ...

    def add_geom(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, fromto: numpy.typing.ArrayLike | None=None, size: typing.Any | None=None, contype: typing.SupportsInt | typing.SupportsIndex | None=None, conaffinity: typing.SupportsInt | typing.SupportsIndex | None=None, condim: typing.SupportsInt | typing.SupportsIndex | None=None, priority: typing.SupportsInt | typing.SupportsIndex | None=None, friction: numpy.typing.ArrayLike | None=None, solmix: typing.SupportsFloat | typing.SupportsIndex | None=None, solref: numpy.typing.ArrayLike | None=None, solimp: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, gap: typing.SupportsFloat | typing.SupportsIndex | None=None, surfacevel: numpy.typing.ArrayLike | None=None, adhesion: typing.SupportsFloat | typing.SupportsIndex | None=None, mass: typing.SupportsFloat | typing.SupportsIndex | None=None, density: typing.SupportsFloat | typing.SupportsIndex | None=None, typeinertia: typing.SupportsInt | typing.SupportsIndex | None=None, fluid_ellipsoid: typing.SupportsInt | typing.SupportsIndex | None=None, fluid_coefs: numpy.typing.ArrayLike | None=None, material: str | None=None, rgba: numpy.typing.ArrayLike | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, castshadow: typing.SupportsInt | typing.SupportsIndex | None=None, hfieldname: str | None=None, meshname: str | None=None, fitscale: typing.SupportsFloat | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, plugin: MjsPlugin | None=None, info: str | None=None) -> MjsGeom:
        ...

    def add_joint(self, default: MjsDefault | None=None, name: str | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, pos: numpy.typing.ArrayLike | None=None, axis: numpy.typing.ArrayLike | None=None, ref: typing.SupportsFloat | typing.SupportsIndex | None=None, align: typing.SupportsInt | typing.SupportsIndex | None=None, stiffness: typing.Any | None=None, springref: typing.SupportsFloat | typing.SupportsIndex | None=None, springyield: typing.SupportsFloat | typing.SupportsIndex | None=None, springdamper: numpy.typing.ArrayLike | None=None, limited: typing.SupportsInt | typing.SupportsIndex | None=None, range: numpy.typing.ArrayLike | None=None, margin: typing.SupportsFloat | typing.SupportsIndex | None=None, solref_limit: numpy.typing.ArrayLike | None=None, solimp_limit: numpy.typing.ArrayLike | None=None, actfrclimited: typing.SupportsInt | typing.SupportsIndex | None=None, actfrcrange: numpy.typing.ArrayLike | None=None, armature: typing.SupportsFloat | typing.SupportsIndex | None=None, damping: typing.Any | None=None, frictionloss: typing.SupportsFloat | typing.SupportsIndex | None=None, solref_friction: numpy.typing.ArrayLike | None=None, solimp_friction: numpy.typing.ArrayLike | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, actgravcomp: typing.SupportsInt | typing.SupportsIndex | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsJoint:
        ...

    def add_light(self, default: MjsDefault | None=None, name: str | None=None, pos: numpy.typing.ArrayLike | None=None, dir: numpy.typing.ArrayLike | None=None, mode: typing.SupportsInt | typing.SupportsIndex | None=None, targetbody: str | None=None, active: typing.SupportsInt | typing.SupportsIndex | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, texture: str | None=None, castshadow: typing.SupportsInt | typing.SupportsIndex | None=None, bulbradius: typing.SupportsFloat | typing.SupportsIndex | None=None, intensity: typing.SupportsFloat | typing.SupportsIndex | None=None, range: typing.SupportsFloat | typing.SupportsIndex | None=None, attenuation: numpy.typing.ArrayLike | None=None, cutoff: typing.SupportsFloat | typing.SupportsIndex | None=None, softness: typing.SupportsFloat | typing.SupportsIndex | None=None, exponent: typing.SupportsFloat | typing.SupportsIndex | None=None, ambient: numpy.typing.ArrayLike | None=None, diffuse: numpy.typing.ArrayLike | None=None, specular: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsLight:
        ...

    def add_site(self, default: MjsDefault | None=None, name: str | None=None, pos: numpy.typing.ArrayLike | None=None, quat: numpy.typing.ArrayLike | None=None, axisangle: numpy.typing.ArrayLike | None=None, xyaxes: numpy.typing.ArrayLike | None=None, zaxis: numpy.typing.ArrayLike | None=None, euler: numpy.typing.ArrayLike | None=None, fromto: numpy.typing.ArrayLike | None=None, size: typing.Any | None=None, type: typing.SupportsInt | typing.SupportsIndex | None=None, material: str | None=None, group: typing.SupportsInt | typing.SupportsIndex | None=None, rgba: numpy.typing.ArrayLike | None=None, meshname: str | None=None, userdata: numpy.typing.ArrayLike | None=None, info: str | None=None) -> MjsSite:
        ...

    def attach_body(self, body: MjsBody, prefix: str | None=None, suffix: str | None=None) -> MjsBody:
        ...

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def massscale(self) -> float:
        ...

    @massscale.setter
    def massscale(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def quat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @quat.setter
    def quat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def scale(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @scale.setter
    def scale(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def scaling(self) -> mujoco._enums.mjtScaling:
        ...

    @scaling.setter
    def scaling(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

class MjsGeom:
    alt: MjsOrientation
    castshadow: bool
    classname: MjsDefault
    hfieldname: str
    info: str
    material: str
    meshname: str
    name: str
    plugin: MjsPlugin

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    @property
    def adhesion(self) -> float:
        ...

    @adhesion.setter
    def adhesion(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def conaffinity(self) -> int:
        ...

    @conaffinity.setter
    def conaffinity(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def condim(self) -> int:
        ...

    @condim.setter
    def condim(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def contype(self) -> int:
        ...

    @contype.setter
    def contype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def density(self) -> float:
        ...

    @density.setter
    def density(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def fitscale(self) -> float:
        ...

    @fitscale.setter
    def fitscale(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def fluid_coefs(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @fluid_coefs.setter
    def fluid_coefs(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def fluid_ellipsoid(self) -> float:
        ...

    @fluid_ellipsoid.setter
    def fluid_ellipsoid(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @friction.setter
    def friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def fromto(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @fromto.setter
    def fromto(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def gap(self) -> float:
        ...

    @gap.setter
    def gap(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def margin(self) -> float:
        ...

    @margin.setter
    def margin(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def mass(self) -> float:
        ...

    @mass.setter
    def mass(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def priority(self) -> int:
        ...

    @priority.setter
    def priority(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def quat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @quat.setter
    def quat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def rgba(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rgba.setter
    def rgba(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def size(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @size.setter
    def size(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solimp(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp.setter
    def solimp(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solmix(self) -> float:
        ...

    @solmix.setter
    def solmix(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def solref(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref.setter
    def solref(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def surfacevel(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @surfacevel.setter
    def surfacevel(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtGeom:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def typeinertia(self) -> mujoco._enums.mjtGeomInertia:
        ...

    @typeinertia.setter
    def typeinertia(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsJoint:
    actgravcomp: bool
    classname: MjsDefault
    info: str
    name: str

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    @property
    def actfrclimited(self) -> mujoco._enums.mjtLimited:
        ...

    @actfrclimited.setter
    def actfrclimited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def actfrcrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @actfrcrange.setter
    def actfrcrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def align(self) -> mujoco._enums.mjtAlignFree:
        ...

    @align.setter
    def align(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def armature(self) -> float:
        ...

    @armature.setter
    def armature(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def axis(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @axis.setter
    def axis(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def damping(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @damping.setter
    def damping(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def frictionloss(self) -> float:
        ...

    @frictionloss.setter
    def frictionloss(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def limited(self) -> mujoco._enums.mjtLimited:
        ...

    @limited.setter
    def limited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def margin(self) -> float:
        ...

    @margin.setter
    def margin(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def range(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @range.setter
    def range(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def ref(self) -> float:
        ...

    @ref.setter
    def ref(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def solimp_friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp_friction.setter
    def solimp_friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solimp_limit(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp_limit.setter
    def solimp_limit(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solref_friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref_friction.setter
    def solref_friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solref_limit(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref_limit.setter
    def solref_limit(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def springdamper(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @springdamper.setter
    def springdamper(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def springref(self) -> float:
        ...

    @springref.setter
    def springref(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def springyield(self) -> float:
        ...

    @springyield.setter
    def springyield(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def stiffness(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @stiffness.setter
    def stiffness(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtJoint:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsLight:
    active: bool
    castshadow: bool
    classname: MjsDefault
    info: str
    name: str
    targetbody: str
    texture: str

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    @property
    def ambient(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @ambient.setter
    def ambient(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def attenuation(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @attenuation.setter
    def attenuation(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def bulbradius(self) -> float:
        ...

    @bulbradius.setter
    def bulbradius(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def cutoff(self) -> float:
        ...

    @cutoff.setter
    def cutoff(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def diffuse(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @diffuse.setter
    def diffuse(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def dir(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @dir.setter
    def dir(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def exponent(self) -> float:
        ...

    @exponent.setter
    def exponent(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def intensity(self) -> float:
        ...

    @intensity.setter
    def intensity(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def mode(self) -> mujoco._enums.mjtCamLight:
        ...

    @mode.setter
    def mode(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def range(self) -> float:
        ...

    @range.setter
    def range(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def softness(self) -> float:
        ...

    @softness.setter
    def softness(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def specular(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @specular.setter
    def specular(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtLightType:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjsMaterial:
    classname: MjsDefault
    info: str
    name: str
    texuniform: bool

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def emission(self) -> float:
        ...

    @emission.setter
    def emission(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def metallic(self) -> float:
        ...

    @metallic.setter
    def metallic(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def reflectance(self) -> float:
        ...

    @reflectance.setter
    def reflectance(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def rgba(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rgba.setter
    def rgba(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def roughness(self) -> float:
        ...

    @roughness.setter
    def roughness(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def shininess(self) -> float:
        ...

    @shininess.setter
    def shininess(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def specular(self) -> float:
        ...

    @specular.setter
    def specular(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def texrepeat(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @texrepeat.setter
    def texrepeat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def textures(self) -> MjStringVec:
        ...

    @textures.setter
    def textures(self, arg1: typing.Any) -> None:
        ...

class MjsSite:
    alt: MjsOrientation
    classname: MjsDefault
    info: str
    material: str
    meshname: str
    name: str

    def attach_body(self, body: MjsBody, prefix: str | None=None, suffix: str | None=None) -> MjsBody:
        ...

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def fromto(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @fromto.setter
    def fromto(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def quat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @quat.setter
    def quat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def rgba(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rgba.setter
    def rgba(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def size(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @size.setter
    def size(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtGeom:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsMesh:
    classname: MjsDefault
    content_type: str
    file: str
    info: str
    material: str
    name: str
    needsdf: bool
    plugin: MjsPlugin
    smoothnormal: bool

    def make_box(self, count: numpy.typing.ArrayLike, spacing: numpy.typing.ArrayLike, dim: typing.SupportsInt | typing.SupportsIndex=3) -> None:
        ...

    def make_cone(self, nedge: typing.SupportsInt | typing.SupportsIndex, radius: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    def make_cylinder(self, count: numpy.typing.ArrayLike, spacing: numpy.typing.ArrayLike, dim: typing.SupportsInt | typing.SupportsIndex=3) -> None:
        ...

    def make_disc(self, count: numpy.typing.ArrayLike, spacing: numpy.typing.ArrayLike) -> None:
        ...

    def make_ellipsoid(self, count: numpy.typing.ArrayLike, spacing: numpy.typing.ArrayLike, dim: typing.SupportsInt | typing.SupportsIndex=3) -> None:
        ...

    def make_grid(self, count: numpy.typing.ArrayLike, spacing: numpy.typing.ArrayLike, dim: typing.SupportsInt | typing.SupportsIndex=3) -> None:
        ...

    def make_hemisphere(self, resolution: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def make_plate(self, resolution: numpy.typing.ArrayLike=...) -> None:
        ...

    def make_sphere(self, subdivision: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def make_square(self, count: numpy.typing.ArrayLike, spacing: numpy.typing.ArrayLike) -> None:
        ...

    def make_supersphere(self, resolution: typing.SupportsInt | typing.SupportsIndex, e: typing.SupportsFloat | typing.SupportsIndex, n: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    def make_supertorus(self, resolution: typing.SupportsInt | typing.SupportsIndex, radius: typing.SupportsFloat | typing.SupportsIndex, s: typing.SupportsFloat | typing.SupportsIndex, t: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    def make_wedge(self, resolution: numpy.typing.ArrayLike=..., fov: numpy.typing.ArrayLike=..., gamma: typing.SupportsFloat | typing.SupportsIndex=0) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def inertia(self) -> mujoco._enums.mjtMeshInertia:
        ...

    @inertia.setter
    def inertia(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def maxhullvert(self) -> int:
        ...

    @maxhullvert.setter
    def maxhullvert(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def octree_maxdepth(self) -> int:
        ...

    @octree_maxdepth.setter
    def octree_maxdepth(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def refpos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @refpos.setter
    def refpos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def refquat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @refquat.setter
    def refquat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def scale(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @scale.setter
    def scale(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def userface(self) -> MjIntVec:
        ...

    @userface.setter
    def userface(self, arg1: typing.Any) -> None:
        ...

    @property
    def userfacenormal(self) -> MjIntVec:
        ...

    @userfacenormal.setter
    def userfacenormal(self, arg1: typing.Any) -> None:
        ...

    @property
    def userfacetexcoord(self) -> MjIntVec:
        ...

    @userfacetexcoord.setter
    def userfacetexcoord(self, arg1: typing.Any) -> None:
        ...

    @property
    def usernode(self) -> MjDoubleVec:
        ...

    @usernode.setter
    def usernode(self, arg1: typing.Any) -> None:
        ...

    @property
    def usernormal(self) -> MjFloatVec:
        ...

    @usernormal.setter
    def usernormal(self, arg1: typing.Any) -> None:
        ...

    @property
    def usertet(self) -> MjIntVec:
        ...

    @usertet.setter
    def usertet(self, arg1: typing.Any) -> None:
        ...

    @property
    def usertexcoord(self) -> MjFloatVec:
        ...

    @usertexcoord.setter
    def usertexcoord(self, arg1: typing.Any) -> None:
        ...

    @property
    def uservert(self) -> MjFloatVec:
        ...

    @uservert.setter
    def uservert(self, arg1: typing.Any) -> None:
        ...

class MjsSkin:
    file: str
    info: str
    material: str
    name: str

    @property
    def bindpos(self) -> MjFloatVec:
        ...

    @bindpos.setter
    def bindpos(self, arg1: typing.Any) -> None:
        ...

    @property
    def bindquat(self) -> MjFloatVec:
        ...

    @bindquat.setter
    def bindquat(self, arg1: typing.Any) -> None:
        ...

    @property
    def bodyname(self) -> MjStringVec:
        ...

    @bodyname.setter
    def bodyname(self, arg1: typing.Any) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def face(self) -> MjIntVec:
        ...

    @face.setter
    def face(self, arg1: typing.Any) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def inflate(self) -> float:
        ...

    @inflate.setter
    def inflate(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def rgba(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rgba.setter
    def rgba(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def texcoord(self) -> MjFloatVec:
        ...

    @texcoord.setter
    def texcoord(self, arg1: typing.Any) -> None:
        ...

    @property
    def vert(self) -> MjFloatVec:
        ...

    @vert.setter
    def vert(self, arg1: typing.Any) -> None:
        ...

    @property
    def vertid(self) -> list[list[int]]:
        ...

    @vertid.setter
    def vertid(self, arg1: typing.Any) -> list[list[int]]:
        ...

    @property
    def vertweight(self) -> list[list[float]]:
        ...

    @vertweight.setter
    def vertweight(self, arg1: typing.Any) -> list[list[float]]:
        ...

class MjsTexture:
    classname: MjsDefault
    content_type: str
    data: bytes
    file: str
    hflip: bool
    info: str
    name: str
    vflip: bool

    @property
    def builtin(self) -> mujoco._enums.mjtBuiltin:
        ...

    @builtin.setter
    def builtin(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def colorspace(self) -> mujoco._enums.mjtColorSpace:
        ...

    @colorspace.setter
    def colorspace(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def cubefiles(self) -> MjStringVec:
        ...

    @cubefiles.setter
    def cubefiles(self, arg1: typing.Any) -> None:
        ...

    @property
    def embed(self) -> mujoco._enums.mjtEmbed:
        ...

    @embed.setter
    def embed(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def gridlayout(self) -> MjCharVec:
        ...

    @gridlayout.setter
    def gridlayout(self, arg1: typing.Any) -> None:
        ...

    @property
    def gridsize(self) -> numpy.typing.NDArray[numpy.int32]:
        ...

    @gridsize.setter
    def gridsize(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def height(self) -> int:
        ...

    @height.setter
    def height(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def mark(self) -> mujoco._enums.mjtMark:
        ...

    @mark.setter
    def mark(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def markrgb(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @markrgb.setter
    def markrgb(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def nchannel(self) -> int:
        ...

    @nchannel.setter
    def nchannel(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def random(self) -> float:
        ...

    @random.setter
    def random(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def rgb1(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @rgb1.setter
    def rgb1(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def rgb2(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @rgb2.setter
    def rgb2(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def type(self) -> mujoco._enums.mjtTexture:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def width(self) -> int:
        ...

    @width.setter
    def width(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjsText:
    data: str
    info: str
    name: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def signature(self) -> int:
        ...

class MjsTuple:
    info: str
    name: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def objname(self) -> MjStringVec:
        ...

    @objname.setter
    def objname(self, arg1: typing.Any) -> None:
        ...

    @property
    def objprm(self) -> MjDoubleVec:
        ...

    @objprm.setter
    def objprm(self, arg1: typing.Any) -> None:
        ...

    @property
    def objtype(self) -> MjIntVec:
        ...

    @objtype.setter
    def objtype(self, arg1: typing.Any) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

class MjsCamera:
    alt: MjsOrientation
    classname: MjsDefault
    info: str
    name: str
    targetbody: str

    def set_frame(self, arg0: MjsFrame) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def focal_length(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @focal_length.setter
    def focal_length(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def focal_pixel(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @focal_pixel.setter
    def focal_pixel(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def fovy(self) -> float:
        ...

    @fovy.setter
    def fovy(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def frame(self) -> MjsFrame:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def intrinsic(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @intrinsic.setter
    def intrinsic(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def ipd(self) -> float:
        ...

    @ipd.setter
    def ipd(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def mode(self) -> mujoco._enums.mjtCamLight:
        ...

    @mode.setter
    def mode(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def output(self) -> int:
        ...

    @output.setter
    def output(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def parent(self) -> MjsBody | typing.Any:
        ...

    @property
    def pos(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @pos.setter
    def pos(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def principal_length(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @principal_length.setter
    def principal_length(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def principal_pixel(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @principal_pixel.setter
    def principal_pixel(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def proj(self) -> mujoco._enums.mjtProjection:
        ...

    @proj.setter
    def proj(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def quat(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @quat.setter
    def quat(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def resolution(self) -> numpy.typing.NDArray[numpy.int32]:
        ...

    @resolution.setter
    def resolution(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def sensor_size(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @sensor_size.setter
    def sensor_size(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsFlex:
    flatskin: bool
    info: str
    name: str

    @property
    def activelayers(self) -> int:
        ...

    @activelayers.setter
    def activelayers(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def cellcount(self) -> numpy.typing.NDArray[numpy.int32]:
        ...

    @cellcount.setter
    def cellcount(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def conaffinity(self) -> int:
        ...

    @conaffinity.setter
    def conaffinity(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def condim(self) -> int:
        ...

    @condim.setter
    def condim(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def contype(self) -> int:
        ...

    @contype.setter
    def contype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def damping(self) -> float:
        ...

    @damping.setter
    def damping(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def dim(self) -> int:
        ...

    @dim.setter
    def dim(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def edgedamping(self) -> float:
        ...

    @edgedamping.setter
    def edgedamping(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def edgestiffness(self) -> float:
        ...

    @edgestiffness.setter
    def edgestiffness(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def elastic2d(self) -> int:
        ...

    @elastic2d.setter
    def elastic2d(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def elastic3d(self) -> int:
        ...

    @elastic3d.setter
    def elastic3d(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def elem(self) -> MjIntVec:
        ...

    @elem.setter
    def elem(self, arg1: typing.Any) -> None:
        ...

    @property
    def elemtexcoord(self) -> MjIntVec:
        ...

    @elemtexcoord.setter
    def elemtexcoord(self, arg1: typing.Any) -> None:
        ...

    @property
    def friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @friction.setter
    def friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def gap(self) -> float:
        ...

    @gap.setter
    def gap(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def margin(self) -> float:
        ...

    @margin.setter
    def margin(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def material(self) -> MjStringVec:
        ...

    @material.setter
    def material(self, arg1: typing.Any) -> None:
        ...

    @property
    def node(self) -> MjDoubleVec:
        ...

    @node.setter
    def node(self, arg1: typing.Any) -> None:
        ...

    @property
    def nodebody(self) -> MjStringVec:
        ...

    @nodebody.setter
    def nodebody(self, arg1: typing.Any) -> None:
        ...

    @property
    def order(self) -> int:
        ...

    @order.setter
    def order(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def passive(self) -> int:
        ...

    @passive.setter
    def passive(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def poisson(self) -> float:
        ...

    @poisson.setter
    def poisson(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def priority(self) -> int:
        ...

    @priority.setter
    def priority(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def radius(self) -> float:
        ...

    @radius.setter
    def radius(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def rgba(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rgba.setter
    def rgba(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def section(self) -> mujoco._enums.mjtFlexSection:
        ...

    @section.setter
    def section(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def sectionsize(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @sectionsize.setter
    def sectionsize(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def selfcollide(self) -> mujoco._enums.mjtFlexSelf:
        ...

    @selfcollide.setter
    def selfcollide(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def shear(self) -> float:
        ...

    @shear.setter
    def shear(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def size(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @size.setter
    def size(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solimp(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp.setter
    def solimp(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solmix(self) -> float:
        ...

    @solmix.setter
    def solmix(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def solref(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref.setter
    def solref(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def stressyield(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @stressyield.setter
    def stressyield(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def texcoord(self) -> MjFloatVec:
        ...

    @texcoord.setter
    def texcoord(self, arg1: typing.Any) -> None:
        ...

    @property
    def thickness(self) -> float:
        ...

    @thickness.setter
    def thickness(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def vert(self) -> MjDoubleVec:
        ...

    @vert.setter
    def vert(self, arg1: typing.Any) -> None:
        ...

    @property
    def vertbody(self) -> MjStringVec:
        ...

    @vertbody.setter
    def vertbody(self, arg1: typing.Any) -> None:
        ...

    @property
    def young(self) -> float:
        ...

    @young.setter
    def young(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjsHField:
    content_type: str
    file: str
    info: str
    name: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def ncol(self) -> int:
        ...

    @ncol.setter
    def ncol(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def nrow(self) -> int:
        ...

    @nrow.setter
    def nrow(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def size(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @size.setter
    def size(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def userdata(self) -> MjFloatVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsKey:
    info: str
    name: str

    @property
    def act(self) -> MjDoubleVec:
        ...

    @act.setter
    def act(self, arg1: typing.Any) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def ctrl(self) -> MjDoubleVec:
        ...

    @ctrl.setter
    def ctrl(self, arg1: typing.Any) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def mpos(self) -> MjDoubleVec:
        ...

    @mpos.setter
    def mpos(self, arg1: typing.Any) -> None:
        ...

    @property
    def mquat(self) -> MjDoubleVec:
        ...

    @mquat.setter
    def mquat(self, arg1: typing.Any) -> None:
        ...

    @property
    def plastic(self) -> MjDoubleVec:
        ...

    @plastic.setter
    def plastic(self, arg1: typing.Any) -> None:
        ...

    @property
    def qpos(self) -> MjDoubleVec:
        ...

    @qpos.setter
    def qpos(self, arg1: typing.Any) -> None:
        ...

    @property
    def qvel(self) -> MjDoubleVec:
        ...

    @qvel.setter
    def qvel(self, arg1: typing.Any) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def time(self) -> float:
        ...

    @time.setter
    def time(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjsNumeric:
    info: str
    name: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def data(self) -> MjDoubleVec:
        ...

    @data.setter
    def data(self, arg1: typing.Any) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def size(self) -> int:
        ...

    @size.setter
    def size(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjsPair:
    classname: MjsDefault
    geomname1: str
    geomname2: str
    info: str
    name: str

    @property
    def adhesion(self) -> float:
        ...

    @adhesion.setter
    def adhesion(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def condim(self) -> int:
        ...

    @condim.setter
    def condim(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @friction.setter
    def friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def gap(self) -> float:
        ...

    @gap.setter
    def gap(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def margin(self) -> float:
        ...

    @margin.setter
    def margin(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def solimp(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp.setter
    def solimp(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solref(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref.setter
    def solref(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solreffriction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solreffriction.setter
    def solreffriction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

class MjsExclude:
    bodyname1: str
    bodyname2: str
    info: str
    name: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def signature(self) -> int:
        ...

class MjsEquality:
    active: bool
    classname: MjsDefault
    info: str
    name: str
    name1: str
    name2: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def data(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @data.setter
    def data(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def objtype(self) -> mujoco._enums.mjtObj:
        ...

    @objtype.setter
    def objtype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def solimp(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp.setter
    def solimp(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solref(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref.setter
    def solref(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtEq:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjsTendon:
    info: str
    material: str
    name: str

    def default(self) -> MjsDefault:
        ...

    def wrap_geom(self, arg0: str, arg1: str) -> MjsWrap:
        ...

    def wrap_joint(self, arg0: str, arg1: typing.SupportsFloat | typing.SupportsIndex) -> MjsWrap:
        ...

    def wrap_pulley(self, arg0: typing.SupportsFloat | typing.SupportsIndex) -> MjsWrap:
        ...

    def wrap_site(self, arg0: str) -> MjsWrap:
        ...

    @property
    def actfrclimited(self) -> mujoco._enums.mjtLimited:
        ...

    @actfrclimited.setter
    def actfrclimited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def actfrcrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @actfrcrange.setter
    def actfrcrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def armature(self) -> float:
        ...

    @armature.setter
    def armature(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def damping(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @damping.setter
    def damping(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def frictionloss(self) -> float:
        ...

    @frictionloss.setter
    def frictionloss(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def limited(self) -> mujoco._enums.mjtLimited:
        ...

    @limited.setter
    def limited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def margin(self) -> float:
        ...

    @margin.setter
    def margin(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def path(self) -> MjsTendonPath:
        ...

    @property
    def range(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @range.setter
    def range(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def rgba(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rgba.setter
    def rgba(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def solimp_friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp_friction.setter
    def solimp_friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solimp_limit(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solimp_limit.setter
    def solimp_limit(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solref_friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref_friction.setter
    def solref_friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def solref_limit(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @solref_limit.setter
    def solref_limit(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def springlength(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @springlength.setter
    def springlength(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def springyield(self) -> float:
        ...

    @springyield.setter
    def springyield(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def stiffness(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @stiffness.setter
    def stiffness(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

    @property
    def width(self) -> float:
        ...

    @width.setter
    def width(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjsSensor:
    info: str
    name: str
    objname: str
    plugin: MjsPlugin
    refname: str

    def get_data_size(self) -> int:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def cutoff(self) -> float:
        ...

    @cutoff.setter
    def cutoff(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def datatype(self) -> mujoco._enums.mjtDataType:
        ...

    @datatype.setter
    def datatype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def delay(self) -> float:
        ...

    @delay.setter
    def delay(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def dim(self) -> int:
        ...

    @dim.setter
    def dim(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def interp(self) -> int:
        ...

    @interp.setter
    def interp(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def interval(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @interval.setter
    def interval(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def intprm(self) -> numpy.typing.NDArray[numpy.int32]:
        ...

    @intprm.setter
    def intprm(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def needstage(self) -> mujoco._enums.mjtStage:
        ...

    @needstage.setter
    def needstage(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def noise(self) -> float:
        ...

    @noise.setter
    def noise(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def nsample(self) -> int:
        ...

    @nsample.setter
    def nsample(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def objtype(self) -> mujoco._enums.mjtObj:
        ...

    @objtype.setter
    def objtype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def reftype(self) -> mujoco._enums.mjtObj:
        ...

    @reftype.setter
    def reftype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def type(self) -> mujoco._enums.mjtSensor:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

class MjsActuator:
    actearly: bool
    classname: MjsDefault
    info: str
    name: str
    plugin: MjsPlugin
    refsite: str
    slidersite: str
    target: str

    def set_to_adhesion(self, gain: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    def set_to_cylinder(self, timeconst: typing.SupportsFloat | typing.SupportsIndex, bias: typing.SupportsFloat | typing.SupportsIndex, area: typing.SupportsFloat | typing.SupportsIndex, diameter: typing.SupportsFloat | typing.SupportsIndex=-1) -> None:
        ...

    def set_to_damper(self, kv: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    def set_to_dcmotor(self, motorconst: numpy.typing.ArrayLike, resistance: typing.SupportsFloat | typing.SupportsIndex, nominal: numpy.typing.ArrayLike=..., saturation: numpy.typing.ArrayLike=..., inductance: numpy.typing.ArrayLike=..., cogging: numpy.typing.ArrayLike=..., controller: numpy.typing.ArrayLike=..., thermal: numpy.typing.ArrayLike=..., lugre: numpy.typing.ArrayLike=..., ctrlspec: typing.SupportsInt | typing.SupportsIndex=0) -> None:
        ...

    def set_to_intvelocity(self, kp: typing.SupportsFloat | typing.SupportsIndex, kv: typing.SupportsFloat | typing.SupportsIndex=-1, dampratio: typing.SupportsFloat | typing.SupportsIndex=-1, timeconst: typing.SupportsFloat | typing.SupportsIndex=-1, inheritrange: bool=False) -> None:
        ...

    def set_to_motor(self) -> None:
        ...

    def set_to_muscle(self, timeconst: numpy.typing.ArrayLike=..., *, tausmooth: typing.SupportsFloat | typing.SupportsIndex, range: numpy.typing.ArrayLike=[-1.0, -1.0], force: typing.SupportsFloat | typing.SupportsIndex=-1, scale: typing.SupportsFloat | typing.SupportsIndex=-1, lmin: typing.SupportsFloat | typing.SupportsIndex=-1, lmax: typing.SupportsFloat | typing.SupportsIndex=-1, vmax: typing.SupportsFloat | typing.SupportsIndex=-1, fpmax: typing.SupportsFloat | typing.SupportsIndex=-1, fvmax: typing.SupportsFloat | typing.SupportsIndex=-1) -> None:
        ...

    def set_to_orientation(self, kp: typing.SupportsFloat | typing.SupportsIndex, kv: typing.SupportsFloat | typing.SupportsIndex=-1, dampratio: typing.SupportsFloat | typing.SupportsIndex=-1, ctrlspec: typing.SupportsInt | typing.SupportsIndex=0) -> None:
        ...

    def set_to_pid(self, kp: typing.SupportsFloat | typing.SupportsIndex, kv: typing.SupportsFloat | typing.SupportsIndex=-1, dampratio: typing.SupportsFloat | typing.SupportsIndex=-1, ki: typing.SupportsFloat | typing.SupportsIndex=-1, imax: typing.SupportsFloat | typing.SupportsIndex=-1, slewmax: typing.SupportsFloat | typing.SupportsIndex=-1, inheritrange: typing.SupportsFloat | typing.SupportsIndex=0, ctrlspec: typing.SupportsInt | typing.SupportsIndex=0) -> None:
        ...

    def set_to_position(self, kp: typing.SupportsFloat | typing.SupportsIndex, kv: typing.SupportsFloat | typing.SupportsIndex=-1, dampratio: typing.SupportsFloat | typing.SupportsIndex=-1, timeconst: typing.SupportsFloat | typing.SupportsIndex=-1, inheritrange: bool=False) -> None:
        ...

    def set_to_velocity(self, kv: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def actdim(self) -> int:
        ...

    @actdim.setter
    def actdim(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def actlimited(self) -> mujoco._enums.mjtLimited:
        ...

    @actlimited.setter
    def actlimited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def actrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @actrange.setter
    def actrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def armature(self) -> float:
        ...

    @armature.setter
    def armature(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def biasprm(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @biasprm.setter
    def biasprm(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def biastype(self) -> mujoco._enums.mjtBias:
        ...

    @biastype.setter
    def biastype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def cranklength(self) -> float:
        ...

    @cranklength.setter
    def cranklength(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def ctrllimited(self) -> mujoco._enums.mjtLimited:
        ...

    @ctrllimited.setter
    def ctrllimited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def ctrlrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @ctrlrange.setter
    def ctrlrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def ctrlspec(self) -> int:
        ...

    @ctrlspec.setter
    def ctrlspec(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def damping(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @damping.setter
    def damping(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def delay(self) -> float:
        ...

    @delay.setter
    def delay(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def dynprm(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @dynprm.setter
    def dynprm(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def dyntype(self) -> mujoco._enums.mjtDyn:
        ...

    @dyntype.setter
    def dyntype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def ffrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @ffrange.setter
    def ffrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def forcelimited(self) -> mujoco._enums.mjtLimited:
        ...

    @forcelimited.setter
    def forcelimited(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def forcerange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @forcerange.setter
    def forcerange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def gainprm(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @gainprm.setter
    def gainprm(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def gaintype(self) -> mujoco._enums.mjtGain:
        ...

    @gaintype.setter
    def gaintype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def gear(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @gear.setter
    def gear(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def group(self) -> int:
        ...

    @group.setter
    def group(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def id(self) -> int:
        ...

    @property
    def inheritrange(self) -> float:
        ...

    @inheritrange.setter
    def inheritrange(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def interp(self) -> int:
        ...

    @interp.setter
    def interp(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def lengthrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @lengthrange.setter
    def lengthrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def nsample(self) -> int:
        ...

    @nsample.setter
    def nsample(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

    @property
    def trntype(self) -> mujoco._enums.mjtTrn:
        ...

    @trntype.setter
    def trntype(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtActuator:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def userdata(self) -> MjDoubleVec:
        ...

    @userdata.setter
    def userdata(self, arg1: typing.Any) -> None:
        ...

    @property
    def velrange(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @velrange.setter
    def velrange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

class MjsPlugin:
    active: bool
    config: dict[str, typing.Any]
    info: str
    name: str
    plugin_name: str

    @property
    def compiler(self) -> MjsCompiler:
        ...

    @property
    def id(self) -> int:
        ...

    @id.setter
    def id(self, arg1: MjsPlugin) -> None:
        ...

    @property
    def signature(self) -> int:
        ...

class MjsOrientation:

    @property
    def axisangle(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @axisangle.setter
    def axisangle(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def euler(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @euler.setter
    def euler(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def type(self) -> mujoco._enums.mjtOrientation:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def xyaxes(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @xyaxes.setter
    def xyaxes(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def zaxis(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @zaxis.setter
    def zaxis(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

class MjsWrap:
    info: str

    @property
    def coef(self) -> typing.Any:
        ...

    @property
    def divisor(self) -> typing.Any:
        ...

    @property
    def sidesite(self) -> MjsSite:
        ...

    @property
    def target(self) -> typing.Any:
        ...

    @property
    def type(self) -> mujoco._enums.mjtWrap:
        ...

    @type.setter
    def type(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjOption:

    @property
    def ccd_iterations(self) -> int:
        ...

    @ccd_iterations.setter
    def ccd_iterations(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def ccd_tolerance(self) -> float:
        ...

    @ccd_tolerance.setter
    def ccd_tolerance(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def cone(self) -> int:
        ...

    @cone.setter
    def cone(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def density(self) -> float:
        ...

    @density.setter
    def density(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def disableactuator(self) -> int:
        ...

    @disableactuator.setter
    def disableactuator(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def disableflags(self) -> int:
        ...

    @disableflags.setter
    def disableflags(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def enableflags(self) -> int:
        ...

    @enableflags.setter
    def enableflags(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def gravity(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @gravity.setter
    def gravity(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def impratio(self) -> float:
        ...

    @impratio.setter
    def impratio(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def integrator(self) -> int:
        ...

    @integrator.setter
    def integrator(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def iterations(self) -> int:
        ...

    @iterations.setter
    def iterations(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def jacobian(self) -> int:
        ...

    @jacobian.setter
    def jacobian(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def ls_iterations(self) -> int:
        ...

    @ls_iterations.setter
    def ls_iterations(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def ls_tolerance(self) -> float:
        ...

    @ls_tolerance.setter
    def ls_tolerance(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def magnetic(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @magnetic.setter
    def magnetic(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def noslip_iterations(self) -> int:
        ...

    @noslip_iterations.setter
    def noslip_iterations(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def noslip_tolerance(self) -> float:
        ...

    @noslip_tolerance.setter
    def noslip_tolerance(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def o_friction(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @o_friction.setter
    def o_friction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def o_margin(self) -> float:
        ...

    @o_margin.setter
    def o_margin(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def o_solimp(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @o_solimp.setter
    def o_solimp(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def o_solref(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @o_solref.setter
    def o_solref(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def sdf_initpoints(self) -> int:
        ...

    @sdf_initpoints.setter
    def sdf_initpoints(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def sdf_iterations(self) -> int:
        ...

    @sdf_iterations.setter
    def sdf_iterations(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def sleep_tolerance(self) -> float:
        ...

    @sleep_tolerance.setter
    def sleep_tolerance(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def solver(self) -> int:
        ...

    @solver.setter
    def solver(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def timestep(self) -> float:
        ...

    @timestep.setter
    def timestep(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def tolerance(self) -> float:
        ...

    @tolerance.setter
    def tolerance(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def viscosity(self) -> float:
        ...

    @viscosity.setter
    def viscosity(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def wind(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @wind.setter
    def wind(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

class MjStatistic:

    @property
    def center(self) -> numpy.typing.NDArray[numpy.float64]:
        ...

    @center.setter
    def center(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def extent(self) -> float:
        ...

    @extent.setter
    def extent(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def meaninertia(self) -> float:
        ...

    @meaninertia.setter
    def meaninertia(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def meanmass(self) -> float:
        ...

    @meanmass.setter
    def meanmass(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def meansize(self) -> float:
        ...

    @meansize.setter
    def meansize(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjVisual:
    global_: mujoco._structs.MjVisual.Global
    headlight: MjVisualHeadlight
    map: mujoco._structs.MjVisual.Map
    quality: mujoco._structs.MjVisual.Quality
    rgba: MjVisualRgba
    scale: mujoco._structs.MjVisual.Scale

class MjVisualHeadlight:

    @property
    def active(self) -> int:
        ...

    @active.setter
    def active(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def ambient(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @ambient.setter
    def ambient(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def diffuse(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @diffuse.setter
    def diffuse(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def specular(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @specular.setter
    def specular(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

class MjVisualRgba:

    @property
    def actuator(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @actuator.setter
    def actuator(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def actuatornegative(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @actuatornegative.setter
    def actuatornegative(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def actuatorpositive(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @actuatorpositive.setter
    def actuatorpositive(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def bv(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @bv.setter
    def bv(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def bvactive(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @bvactive.setter
    def bvactive(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def camera(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @camera.setter
    def camera(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def com(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @com.setter
    def com(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def connect(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @connect.setter
    def connect(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def constraint(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @constraint.setter
    def constraint(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def contactforce(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @contactforce.setter
    def contactforce(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def contactfriction(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @contactfriction.setter
    def contactfriction(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def contactgap(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @contactgap.setter
    def contactgap(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def contactpoint(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @contactpoint.setter
    def contactpoint(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def contacttorque(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @contacttorque.setter
    def contacttorque(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def crankbroken(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @crankbroken.setter
    def crankbroken(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def fog(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @fog.setter
    def fog(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def force(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @force.setter
    def force(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def frustum(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @frustum.setter
    def frustum(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def haze(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @haze.setter
    def haze(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def inertia(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @inertia.setter
    def inertia(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def joint(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @joint.setter
    def joint(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def light(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @light.setter
    def light(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def rangefinder(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @rangefinder.setter
    def rangefinder(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def selectpoint(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @selectpoint.setter
    def selectpoint(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def slidercrank(self) -> numpy.typing.NDArray[numpy.float32]:
        ...

    @slidercrank.setter
    def slidercrank(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

class MjsCompiler:
    LRopt: mujoco._structs.MjLROpt
    alignfree: bool
    autolimits: bool
    balanceinertia: bool
    degree: bool
    discardvisual: bool
    fitaabb: bool
    fusestatic: bool
    meshdir: str
    savecanonical: bool
    savecompiled: bool
    saveinertial: bool
    texturedir: str
    usethread: bool

    @property
    def authored(self) -> int:
        ...

    @authored.setter
    def authored(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def boundinertia(self) -> float:
        ...

    @boundinertia.setter
    def boundinertia(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def boundmass(self) -> float:
        ...

    @boundmass.setter
    def boundmass(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

    @property
    def conflict(self) -> mujoco._enums.mjtConflict:
        ...

    @conflict.setter
    def conflict(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def eulerseq(self) -> MjCharVec:
        ...

    @eulerseq.setter
    def eulerseq(self, arg1: typing.Any) -> None:
        ...

    @property
    def inertiafromgeom(self) -> mujoco._enums.mjtInertiaFromGeom:
        ...

    @inertiafromgeom.setter
    def inertiafromgeom(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def inertiagrouprange(self) -> numpy.typing.NDArray[numpy.int32]:
        ...

    @inertiagrouprange.setter
    def inertiagrouprange(self, arg1: numpy.typing.ArrayLike) -> None:
        ...

    @property
    def passthrough(self) -> mujoco._enums.mjtPassthrough:
        ...

    @passthrough.setter
    def passthrough(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def settotalmass(self) -> float:
        ...

    @settotalmass.setter
    def settotalmass(self, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjsAuthored:

    @property
    def disableactuator(self) -> int:
        ...

    @disableactuator.setter
    def disableactuator(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def disableflags(self) -> int:
        ...

    @disableflags.setter
    def disableflags(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def enableflags(self) -> int:
        ...

    @enableflags.setter
    def enableflags(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def option(self) -> int:
        ...

    @option.setter
    def option(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def visual_global(self) -> int:
        ...

    @visual_global.setter
    def visual_global(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def visual_headlight(self) -> int:
        ...

    @visual_headlight.setter
    def visual_headlight(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def visual_map(self) -> int:
        ...

    @visual_map.setter
    def visual_map(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def visual_quality(self) -> int:
        ...

    @visual_quality.setter
    def visual_quality(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def visual_rgba(self) -> int:
        ...

    @visual_rgba.setter
    def visual_rgba(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    @property
    def visual_scale(self) -> int:
        ...

    @visual_scale.setter
    def visual_scale(self, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjCharVec:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> str:
        ...

    def __init__(self, arg0: str, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def __iter__(self) -> collections.abc.Iterator[str]:
        ...

    def __len__(self) -> int:
        ...

    def __setitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: str) -> None:
        ...

class MjStringVec:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> str:
        ...

    def __init__(self, arg0: str, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def __iter__(self) -> collections.abc.Iterator[str]:
        ...

    def __len__(self) -> int:
        ...

    def __setitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: str) -> None:
        ...

class MjByteVec:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> int:
        ...

    def __init__(self, arg0: int, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def __iter__(self) -> collections.abc.Iterator[int]:
        ...

    def __len__(self) -> int:
        ...

    def __setitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: int) -> None:
        ...

class MjDoubleVec:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> float:
        ...

    def __init__(self, arg0: typing.SupportsFloat | typing.SupportsIndex, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def __iter__(self) -> collections.abc.Iterator[float]:
        ...

    def __len__(self) -> int:
        ...

    def __setitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjFloatVec:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> float:
        ...

    def __init__(self, arg0: typing.SupportsFloat | typing.SupportsIndex, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def __iter__(self) -> collections.abc.Iterator[float]:
        ...

    def __len__(self) -> int:
        ...

    def __setitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: typing.SupportsFloat | typing.SupportsIndex) -> None:
        ...

class MjIntVec:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> int:
        ...

    def __init__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

    def __iter__(self) -> collections.abc.Iterator[int]:
        ...

    def __len__(self) -> int:
        ...

    def __setitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex, arg1: typing.SupportsInt | typing.SupportsIndex) -> None:
        ...

class MjVfs:

    def __contains__(self, arg0: str) -> bool:
        ...

    def __delitem__(self, arg0: str) -> None:
        ...

    def __enter__(self) -> MjVfs:
        ...

    def __exit__(self, arg0: typing.Any, arg1: typing.Any, arg2: typing.Any) -> None:
        ...

    def __init__(self) -> None:
        ...

    def __setitem__(self, arg0: str, arg1: bytes) -> None:
        ...

    def close(self) -> None:
        ...

class MjsTendonPath:

    def __getitem__(self, arg0: typing.SupportsInt | typing.SupportsIndex) -> MjsWrap:
        ...

    def __len__(self) -> int:
        ...
