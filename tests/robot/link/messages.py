"""Hypothesis strategies for every message of the link, made from the types of its fields."""

from typing import Any

from hypothesis import strategies as st
from msgspec import inspect

from shapechanger.robot.link.messages import ClientMessage, RobotMessage


def strategy(kind: inspect.Type) -> st.SearchStrategy[Any]:
    """Return a strategy for the values of a type."""
    match kind:
        case inspect.StructType(cls=cls, fields=fields):
            return st.builds(cls, **{field.name: strategy(field.type) for field in fields})
        case inspect.UnionType(types=types):
            return st.one_of(map(strategy, types))
        case inspect.IntType(ge=least, le=most):
            least = -(2**63) if least is None else least
            return st.integers(least, 2**63 - 1 if most is None else most)
        case inspect.FloatType(ge=least, gt=above, le=most):
            low = above if least is None else least
            return st.floats(low, most, exclude_min=above is not None, allow_nan=False)
        case inspect.StrType(pattern=str(pattern)):
            return st.from_regex(pattern).filter(lambda text: len(text) <= 40)
        case inspect.StrType(min_length=least):
            return st.text(min_size=least or 0, max_size=40)
        case inspect.BytesType():
            return st.binary(max_size=64)
        case inspect.VarTupleType(item_type=item):
            return st.lists(strategy(item), max_size=4).map(tuple)
        case inspect.TupleType(item_types=items):
            return st.tuples(*map(strategy, items))
        case inspect.DictType(key_type=key, value_type=value):
            return st.dictionaries(strategy(key), strategy(value), max_size=4)
        case inspect.LiteralType(values=values):
            return st.sampled_from(values)
        case inspect.BoolType():
            return st.booleans()
        case _:
            return st.none()


client_messages: st.SearchStrategy[ClientMessage] = st.one_of(
    strategy(inspect.type_info(kind)) for kind in ClientMessage.__subclasses__()
)
robot_messages: st.SearchStrategy[RobotMessage] = st.one_of(
    strategy(inspect.type_info(kind)) for kind in RobotMessage.__subclasses__()
)
