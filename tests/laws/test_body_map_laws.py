"""Laws of body maps."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from shapechanger.layout import Feature, Layout
from shapechanger.transfer.body_map import BodyMap, Copy, Hold, Learn, MapEntry, Zero
from shapechanger.transfer.body_map.rules import Rule

# A fixed number of examples.
law = settings(max_examples=25)

NAMES = ("hip/angle", "ankle/angle", "Größe µ", 'odd "name"', "a\\b\t\x7f", "x[0]", "eye")
# Powers of two: their products and quotients are exact, so that maps can be compared for equality.
SCALES = st.sampled_from([1.0, -1.0, 2.0, -0.5, 0.25, 8.0])


def feature(name: str) -> Feature:
    return Feature(name, "1", shape=(2, 2) if name == "eye" else (), gain_unit="N·m")


@st.composite
def layouts(draw: st.DrawFn) -> Layout:
    names = draw(st.lists(st.sampled_from(NAMES), unique=True, min_size=1))
    return Layout(tuple(feature(name) for name in names))


def rules(
    over: Layout, shape: tuple[int, ...], scales: st.SearchStrategy[float]
) -> st.SearchStrategy[Rule]:
    constant = st.one_of(
        st.just(Zero()), st.just(Learn()), st.builds(Hold, st.sampled_from([-1.0, 0.1, 2.0]))
    )
    fitting = [taken.name for taken in over if taken.shape == shape]
    if not fitting:
        return constant
    # Listed twice, so that most rules copy.
    take = st.builds(Copy, st.sampled_from(fitting), scales)
    return st.one_of(take, take, constant)


@st.composite
def maps(
    draw: st.DrawFn,
    source: tuple[Layout, Layout] | None = None,
    scales: st.SearchStrategy[float] = SCALES,
) -> BodyMap:
    source_observation, source_action = source or (draw(layouts()), draw(layouts()))
    target_observation, target_action = draw(layouts()), draw(layouts())

    def entries(into: Layout, over: Layout) -> tuple[MapEntry, ...]:
        return tuple(MapEntry(f.name, draw(rules(over, f.shape, scales))) for f in into)

    return BodyMap(
        source_observation,
        target_observation,
        source_action,
        target_action,
        entries(source_observation, target_observation),
        entries(target_action, source_action),
    )


@st.composite
def chains(draw: st.DrawFn, length: int) -> list[BodyMap]:
    links = [draw(maps())]
    while len(links) < length:
        last = links[-1]
        links.append(draw(maps((last.target_observation, last.target_action))))
    return links


@st.composite
def one_to_one(draw: st.DrawFn) -> BodyMap:
    built = draw(maps())

    def thinned(entries: tuple[MapEntry, ...]) -> tuple[MapEntry, ...]:
        seen: set[str] = set()
        kept: list[MapEntry] = []
        for entry in entries:
            again = isinstance(entry.rule, Copy) and entry.rule.feature in seen
            if isinstance(entry.rule, Copy):
                seen.add(entry.rule.feature)
            kept.append(MapEntry(entry.feature, Zero()) if again else entry)
        return tuple(kept)

    return BodyMap(
        built.source_observation,
        built.target_observation,
        built.source_action,
        built.target_action,
        thinned(built.observation),
        thinned(built.action),
    )


@law
@given(links=chains(3))
def test_composition_is_associative(links: list[BodyMap]) -> None:
    a, b, c = links
    left, right = a.then(b).then(c), a.then(b.then(c))
    assert left == right
    assert left.table() == right.table()


@law
@given(built=maps())
def test_the_identity_is_neutral(built: BodyMap) -> None:
    before = BodyMap.identity(built.source_observation, built.source_action)
    after = BodyMap.identity(built.target_observation, built.target_action)
    assert before.then(built) == built == built.then(after)
    assert before.then(built).table() == built.table() == built.then(after).table()


@law
@given(links=chains(2), seed=st.integers(0, 2**32 - 1))
def test_a_composed_map_adapts_as_its_links_do(links: list[BodyMap], seed: int) -> None:
    """The matrices of a chain are the products of the matrices of its links."""
    a, b = links
    both = a.then(b)
    rng = np.random.default_rng(seed)
    sensed = rng.normal(size=(3, both.target_observation.size))
    moved = rng.normal(size=(3, both.source_action.size))
    np.testing.assert_allclose(
        both.adapt_observation(sensed), a.adapt_observation(b.adapt_observation(sensed))
    )
    np.testing.assert_allclose(both.adapt_action(moved), b.adapt_action(a.adapt_action(moved)))
    np.testing.assert_allclose(both.observation_matrix, a.observation_matrix @ b.observation_matrix)
    np.testing.assert_allclose(both.action_matrix, b.action_matrix @ a.action_matrix)


@law
@given(built=one_to_one())
def test_there_and_back_is_the_identity_where_it_matched(built: BodyMap) -> None:
    """Copied features return to themselves; others keep their rule."""
    there_and_back = built.then(built.inverse("learn"))
    for before, after in zip(built.observation, there_and_back.observation, strict=True):
        expected = Copy(before.feature) if isinstance(before.rule, Copy) else before.rule
        assert after.rule == expected
    back_and_there = built.inverse("learn").then(built)
    for before, after in zip(built.action, back_and_there.action, strict=True):
        expected = Copy(before.feature) if isinstance(before.rule, Copy) else before.rule
        assert after.rule == expected


@law
@given(built=maps(scales=st.floats(1e-3, 1e3)))
def test_json_round_trip(built: BodyMap) -> None:
    """A map that is written as JSON and read again is equal, and so is its table."""
    again = BodyMap.from_json(built.to_json())
    assert again == built
    assert again.table() == built.table()


@law
@given(legs=st.integers(1, 4), flip=st.booleans(), order=st.randoms(use_true_random=False))
def test_a_mirror_is_its_own_inverse(legs: int, flip: bool, order: object) -> None:
    """Mirroring twice is the identity, in any order of the features."""
    names = [f"torso/{q}" for q in ("y", "qw", "qx", "qy", "qz", "vx", "vy", "wx", "wy", "wz")]
    names += [
        f"{joint}_{side}{leg}/{quantity}"
        for joint in ("hip", "ankle")
        for side in "lr"
        for leg in range(legs)
        for quantity in ("angle", "velocity", "contact/fy", "contact/tx")
    ]
    order.shuffle(names)  # type: ignore[attr-defined]
    observation = Layout(tuple(Feature(name, "1") for name in names))
    action = Layout(tuple(Feature(f"hip_{side}0/motor", "1", -1.0, 1.0) for side in "lr"))
    image = BodyMap.mirror(
        observation, action, swap={"*_l*": "*_r*"}, flip=["hip_*"] if flip else []
    )
    assert image.inverse() == image
    assert image.then(image) == BodyMap.identity(observation, action) != image


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@law
@given(layout=layouts(), more=layouts(), seed=st.integers(0, 2**32 - 1))
def test_matched_entries_are_bit_exact(
    dtype: type, layout: Layout, more: Layout, seed: int
) -> None:
    target = Layout((*more.features, *(f for f in layout if f.name not in more)))
    built = BodyMap.between(layout, target, layout, target)
    values = np.random.default_rng(seed).normal(size=target.size).astype(dtype)
    adapted = built.adapt_observation(values)
    for name, place in layout.slices.items():
        assert adapted[place].tobytes() == values[target.slices[name]].tobytes()
