"""Model files of a user's robot: how they are found, read, rigged and refused."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
import pytest

from shapechanger.envs.own import own_family, require_robot
from shapechanger.errors import BrokenModel, MorphologyError, UnknownName
from shapechanger.morphology import (
    AddFloor,
    AddFreeJoint,
    AddMotor,
    Stretch,
    TotalMass,
    compile_body,
)
from tests.morphology.models import LEG, URDF

# A pyramid, as a mesh.
_OBJ = "v 0 0 0\nv .2 0 0\nv 0 .2 0\nv 0 0 .2\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def _written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_file_is_a_family(tmp_path: Path) -> None:
    """The only named body of the family is the file's; edits make others."""
    path = _written(tmp_path, "leg.xml", LEG)
    family = own_family(path)
    assert (family.name, family.body("leg")) == ("leg", ())
    long = compile_body(family.load(path), (Stretch("shin", 2.0),))
    assert long.geom("shin").size[1] == pytest.approx(0.2)
    with pytest.raises(UnknownName, match="No body of the family leg matches 'big'"):
        family.body("big")


def test_a_family_depends_on_the_file_and_the_rig(tmp_path: Path) -> None:
    """Bodies can be interpolated only if they have the same file and rig."""
    leg, arm = _written(tmp_path, "leg.xml", LEG), _written(tmp_path, "arm.urdf", URDF)
    assert own_family(leg).key == own_family(str(leg)).key
    keys = {own_family(leg).key, own_family(arm).key, own_family(arm, (AddFloor(),)).key}
    assert len(keys) == 3


def test_a_urdf_is_rigged(tmp_path: Path) -> None:
    """The base keeps its name, although MuJoCo would merge it with the world."""
    path = _written(tmp_path, "arm.urdf", URDF)
    assert compile_body(own_family(path).load(path)).body("base").mass == 2.0
    rig = (AddMotor("shoulder"), AddMotor("elbow", 2.0), AddFreeJoint("base"), AddFloor())
    model = compile_body(own_family(path, rig).load(path))
    assert (model.nu, model.nq) == (2, 9)
    require_robot(model, path)


def test_unnamed_elements_get_names(tmp_path: Path) -> None:
    text = (
        '<mujoco><worldbody><body><joint/><geom size=".1"/></body></worldbody><actuator><motor '
        'joint="j" ctrlrange="-1 1"/></actuator></mujoco>'
    ).replace("<joint/>", '<joint name="j"/><joint axis="1 0 0"/>')
    path = _written(tmp_path, "nameless.xml", text)
    model = compile_body(own_family(path).load(path))
    assert [model.joint(i).name for i in range(2)] == ["j", "j_joint"]
    assert (model.body(1).name, model.actuator(0).name) == ("j", "j")


def test_meshes_lie_beside_the_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes are found next to the model file from any working directory."""
    (tmp_path / "parts").mkdir()
    _written(tmp_path / "parts", "wedge.obj", _OBJ)
    text = (
        '<mujoco><compiler meshdir="parts"/><asset><mesh file="wedge.obj"/></asset><worldbody>'
        '<body name="wedge"><joint/><geom type="mesh" mesh="wedge"/></body></worldbody></mujoco>'
    )
    path = _written(tmp_path, "wedge.xml", text)
    monkeypatch.chdir(tmp_path.parent)
    family = own_family(path)
    assert compile_body(family.load(path), (AddMotor("*", 1.0),)).nmesh == 1
    (tmp_path / "parts" / "wedge.obj").unlink()
    with pytest.raises(BrokenModel, match=r"wedge\.obj"):
        compile_body(family.load(path))


def test_files_that_do_not_exist_are_named(tmp_path: Path) -> None:
    """The message lists the models in the same folder."""
    _written(tmp_path, "robot.xml", LEG)
    _written(tmp_path, "notes.txt", "")
    with pytest.raises(
        UnknownName, match=r"matches 'robto.xml'. Did you mean 'robot.xml'\? There are: robot.xml\."
    ):
        own_family(tmp_path / "robto.xml")
    with pytest.raises(MorphologyError, match="is a folder: name a file"):
        own_family(tmp_path)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<mujoco><worldbody><bdy/></worldbody></mujoco>", "unrecognized element; Element 'bdy'"),
        ("no XML", "MuJoCo cannot read"),
    ],
)
def test_files_that_cannot_be_read_are_refused(tmp_path: Path, text: str, sentence: str) -> None:
    """The message quotes MuJoCo's on one line."""
    path = _written(tmp_path, "broken.xml", text)
    with pytest.raises(BrokenModel, match=sentence) as refusal:
        own_family(path).load(path)
    assert "\n" not in str(refusal.value)


_LINK = """
<robot name="link"><link name="base"/><link name="tip"><inertial><mass value="1"/>
  <inertia ixx=".1" iyy=".1" izz="{inertia}" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><mesh filename="{mesh}"/></geometry></collision></link>
  <joint name="hinge" type="revolute"><parent link="base"/><child link="tip"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="7" velocity="1"/></joint></robot>
"""


@pytest.mark.parametrize("scheme", ["package://", "package:///", "model://"])
def test_packages_of_a_urdf_are_folders_around_it(tmp_path: Path, scheme: str) -> None:
    """The folder may be next to the URDF or above it, after any number of slashes."""
    (tmp_path / "parts" / "urdf").mkdir(parents=True)
    _written(tmp_path / "parts", "wedge.obj", _OBJ)
    text = _LINK.format(mesh=f"{scheme}parts/wedge.obj", inertia=".1")
    for folder in (tmp_path / "parts" / "urdf", tmp_path):
        file = _written(folder, "link.urdf", text)
        assert compile_body(own_family(file).load(file)).nmesh == 1
    (tmp_path / "parts" / "wedge.obj").unlink()
    with pytest.raises(BrokenModel, match=r"is in no folder 'parts' that contains link\.urdf"):
        own_family(file).load(file)


def test_a_rig_on_a_robot_that_does_not_compile_is_refused(tmp_path: Path) -> None:
    """The message has MuJoCo's reason, or for a COLLADA mesh the formats that MuJoCo reads."""
    _written(tmp_path, "wedge.obj", _OBJ)
    file = _written(tmp_path, "link.urdf", _LINK.format(mesh="wedge.obj", inertia="9"))
    # `TotalMass` compiles the robot to compute its mass.
    family = own_family(file, (TotalMass(2.0),))
    with pytest.raises(BrokenModel, match=r"MuJoCo cannot compile link\.urdf: inertia must"):
        family.load(file)
    with pytest.raises(UnknownName, match="No joint matches 'knee'"):
        own_family(file, (AddMotor("knee"),)).load(file)
    _written(tmp_path, "link.urdf", _LINK.format(mesh="wedge.DAE", inertia=".1"))
    with pytest.raises(BrokenModel, match=r"wedge\.DAE, and MuJoCo does not read COLLADA"):
        family.load(file)


def test_robots_need_motors_with_a_range(tmp_path: Path) -> None:
    """The error names the edit that adds motors, or the actuators without a range."""
    path = _written(tmp_path, "arm.urdf", URDF)
    model = compile_body(own_family(path).load(path))
    with pytest.raises(MorphologyError, match=r"arm\.urdf has no actuators.*AddMotor\('\*'\)\."):
        require_robot(model, path)
    with pytest.raises(MorphologyError, match=r"AddMotor\('\*', GEAR\)"):
        require_robot(model, path.with_suffix(".xml"))
    text = LEG.replace('ctrlrange="-1 1" ctrllimited="true"', "", 1)
    free = mujoco.MjModel.from_xml_string(text)
    with pytest.raises(MorphologyError, match=r"actuators of leg\.xml have no ctrlrange.*: hip"):
        require_robot(free, Path("leg.xml"))


@pytest.fixture
def descriptions(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return the folder of a fake `robot_descriptions` with some robots."""
    package = tmp_path / "robot_descriptions"
    package.mkdir()
    _written(package, "__init__.py", "")
    names = ["leg_mj_description", "arm_description", "ghost_description", "lost_description"]
    _written(package, "_descriptions.py", f"DESCRIPTIONS = dict.fromkeys({names})")
    leg, arm = _written(tmp_path, "leg.xml", LEG), _written(tmp_path, "arm.urdf", URDF)
    _written(package, "leg_mj_description.py", f"MJCF_PATH = {str(leg)!r}")
    _written(package, "arm_description.py", f"URDF_PATH = {str(arm)!r}")
    _written(package, "ghost_description.py", "")
    _written(package, "lost_description.py", "raise OSError('no network:\\n  try later.')")
    monkeypatch.syspath_prepend(str(tmp_path))
    for module in [name for name in sys.modules if name.split(".")[0] == "robot_descriptions"]:
        monkeypatch.delitem(sys.modules, module)
    yield tmp_path
    for module in [name for name in sys.modules if name.split(".")[0] == "robot_descriptions"]:
        del sys.modules[module]


def test_robots_of_the_package_have_names(descriptions: Path) -> None:
    assert own_family("leg_mj_description").path == (descriptions / "leg.xml").resolve()
    family = own_family("arm_description", (AddMotor("*", 1.0),))
    np.testing.assert_array_equal(compile_body(family.load(family.path)).actuator_gear[:, 0], 1.0)


@pytest.mark.usefixtures("descriptions")
@pytest.mark.parametrize(
    ("name", "error", "sentence"),
    [
        ("leg_description", UnknownName, "No robot of robot_descriptions matches 'leg_descr"),
        ("ghost_description", MorphologyError, "ghost_description of robot_descriptions has nei"),
        ("lost_description", MorphologyError, "cannot fetch lost_description: no network:; try"),
    ],
)
def test_robots_that_the_package_lacks_are_named(
    name: str, error: type[Exception], sentence: str
) -> None:
    """The message has the nearest name, or the reason of a failure."""
    with pytest.raises(error, match=sentence):
        own_family(name)


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    """The message has the command that installs the package."""
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(MorphologyError, match="run `pip install robot_descriptions`"):
        own_family("go2_mj_description")
