"""What an env or a task may read of a model besides its motion."""

from __future__ import annotations

import mujoco
import pytest

from shapechanger.morphology.certificate.changes import differences
from shapechanger.morphology.certificate.numbers import sensed_numbers

PLAIN = """<mujoco>
  <asset><texture name="sky" type="skybox" builtin="flat" width="4" height="4"/></asset>
  <worldbody><body name="leg"><joint name="knee"/>
    <geom name="shin" size="0.1" rgba="1 0 0 1"/><site name="toe" pos="0 0 0.1"/>
    <camera name="eye" pos="0 0 1"/><light pos="0 0 3"/></body></worldbody>
  <sensor><jointpos name="angle" joint="knee" cutoff="1"/><force site="toe"/></sensor>
  <keyframe><key name="home" qpos="0.5"/></keyframe>
  <custom><numeric name="target" data="1 2"/></custom>
</mujoco>"""


@pytest.mark.parametrize(
    ("old", "new", "drawn"),
    [
        ("0 0 0.1", "0 0 0.2", False),
        ('cutoff="1"', 'cutoff="2"', False),
        ('qpos="0.5"', 'qpos="0.6"', False),
        ('data="1 2"', 'data="1 3"', False),
        ('jointpos name="angle"', 'jointvel name="angle"', False),
        ('0 0 1"/><light', '0 0 2"/><light', True),
        ("1 0 0 1", "0 1 0 1", True),
        ("0 0 3", "0 0 4", True),
    ],
)
def test_each_change_counts_where_it_can_be_read(old: str, new: str, drawn: bool) -> None:
    """Cameras, colours and lights count only where frames are observed."""
    assert old in PLAIN
    one, two = (
        mujoco.MjModel.from_xml_string(text) for text in (PLAIN, PLAIN.replace(old, new, 1))
    )
    for frames in (False, True):
        models = sensed_numbers(one, drawn=frames), sensed_numbers(two, drawn=frames)
        assert bool(differences(*models)) == (frames or not drawn)
        again = sensed_numbers(one, drawn=frames)
        assert not differences(models[0], again)
