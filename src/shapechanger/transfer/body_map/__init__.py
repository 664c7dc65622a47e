"""Maps between the observations and actions of two bodies, matched by name.

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

from shapechanger.transfer.body_map.envs import MappedEnv, body_map
from shapechanger.transfer.body_map.map import BodyMap
from shapechanger.transfer.body_map.rules import Copy, Hold, Learn, MapEntry, Zero

__all__ = ["BodyMap", "Copy", "Hold", "Learn", "MapEntry", "MappedEnv", "Zero", "body_map"]
