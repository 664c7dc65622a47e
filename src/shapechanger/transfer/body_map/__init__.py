"""How the numbers of two bodies correspond, so that a policy can cross from one to the other.

>>> from shapechanger.layout import Feature, Layout
>>> short = Layout((Feature("hip/angle", "rad"),))
>>> long = Layout((Feature("hip/angle", "rad"), Feature("knee/angle", "rad")))
>>> motors = Layout((Feature("hip/motor", "1", -1.0, 1.0),))
>>> more = Layout((*motors.features, Feature("knee/motor", "1", -1.0, 1.0)))
>>> ours = BodyMap.between(short, long, motors, more, rules={"knee/motor": "copy hip/motor"})
>>> print(ours)
side         entry       rule       why
observation  hip/angle   hip/angle  same name
action       hip/motor   hip/motor  same name
action       knee/motor  hip/motor  rule 'knee/motor'
>>> ours.adapt_action([0.5])
array([0.5, 0.5])
"""

from shapechanger.transfer.body_map.entries import Entry
from shapechanger.transfer.body_map.envs import MappedEnv, body_map, wrap
from shapechanger.transfer.body_map.map import BodyMap, Row
from shapechanger.transfer.body_map.matching import Units
from shapechanger.transfer.body_map.mirror import mirror
from shapechanger.transfer.body_map.rules import Hold, Learn, Rule, RuleLike, Take, Zero
from shapechanger.transfer.body_map.symmetry import Symmetry

__all__ = [
    "BodyMap",
    "Entry",
    "Hold",
    "Learn",
    "MappedEnv",
    "Row",
    "Rule",
    "RuleLike",
    "Symmetry",
    "Take",
    "Units",
    "Zero",
    "body_map",
    "mirror",
    "wrap",
]
