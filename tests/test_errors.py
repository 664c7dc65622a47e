"""The exception hierarchy and its messages."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shapechanger.errors as errors
from shapechanger.errors import (
    LARGEST_SEED,
    MissingExtra,
    ShapechangerError,
    StudyError,
    UnknownName,
    check_seed,
    needing_extra,
    no_policy_file,
)

_CLASSES = [
    name
    for name, value in vars(errors).items()
    if isinstance(value, type) and value.__module__ == errors.__name__
]


def test_unknown_names_suggest_the_nearest() -> None:
    """The message lists at most 40 names; the error keeps all."""
    error = UnknownName("body", "thgih", iter(["torso", "thigh"]), "Or give none.")
    message = "No body matches 'thgih'. Did you mean 'thigh'? There are: torso, thigh."
    assert str(error) == f"{message} Or give none."
    assert (error.kind, error.name, error.known) == ("body", "thgih", ("torso", "thigh"))
    assert str(UnknownName("body", "wheel", [])) == "No body matches 'wheel'. There are: none."
    many = UnknownName("joint", "x", [f"j{i}" for i in range(43)])
    assert str(many).endswith("j38, j39 and 3 more.")
    assert len(many.known) == 43
    assert "more" not in str(UnknownName("joint", "x", [f"j{i}" for i in range(40)]))


def test_missing_extras_name_the_command() -> None:
    error = MissingExtra("mujoco", "sim")
    assert "run `pip install 'shapechanger[sim]'`" in str(error)
    assert (error.package, error.extra) == ("mujoco", "sim")
    with pytest.raises(MissingExtra, match="This needs no_such_package"), needing_extra("sim"):
        import no_such_package  # noqa: F401  # pyright: ignore[reportMissingImports, reportUnusedImport]
    with pytest.raises(ZeroDivisionError), needing_extra("sim"):
        _ = 1 / 0


@pytest.mark.parametrize(
    "error",
    [UnknownName("body", "thgih", ["thigh"], "Or give none."), MissingExtra("mujoco", "sim")],
)
def test_errors_can_be_pickled(error: ShapechangerError) -> None:
    """A pickled error keeps its message and its fields."""
    copy = pickle.loads(pickle.dumps(error))
    assert (type(copy), str(copy), vars(copy)) == (type(error), str(error), vars(error))


def test_a_missing_policy_file_names_the_nearest(tmp_path: Path) -> None:
    """The nearest file of the same kind, or the nearest valid word, is named."""
    for name in ("ant.safetensors", "ant.onnx", "cheetah.safetensors"):
        (tmp_path / name).touch()
    near = no_policy_file(tmp_path / "aant.safetensors")
    assert near.endswith(f"; did you mean {tmp_path / 'ant.safetensors'}?")
    assert no_policy_file(Path("referense"), ["reference"]) == (
        "There is no policy file referense; did you mean reference?"
    )
    assert no_policy_file(tmp_path / "ant.**").endswith("ant.**.")  # "*" is not a wildcard.
    assert no_policy_file(Path("nowhere/x.onnx")) == "There is no policy file nowhere/x.onnx."


@given(seed=st.integers(0, LARGEST_SEED), kind=st.sampled_from([int, np.int64, np.uint64]))
def test_whole_numbers_are_seeds(seed: int, kind: type[int]) -> None:
    """Integers of Python and NumPy from 0 to 2^32 - 1 are returned as `int`."""
    found = check_seed(kind(seed), StudyError)
    assert (type(found), found) == (int, seed)
    assert check_seed(2**80 + seed, StudyError, largest=None) == 2**80 + seed


@given(
    seed=st.one_of(
        st.integers(max_value=-1),
        st.integers(LARGEST_SEED + 1),
        st.floats(),
        st.booleans(),
        st.text(),
        st.binary(),
        st.none(),
        st.sampled_from([2**63, 2**64, np.float64(3.0), np.bool_(1), "3", [3], np.array([1, 2])]),
    )
)
def test_other_seeds_are_refused(seed: object) -> None:
    """The message states the range and the given value."""
    with pytest.raises(
        StudyError, match=r"A seed must be a whole number from 0 to 4294967295, got ."
    ):
        check_seed(seed, StudyError)


def test_translated_error_keeps_its_cause() -> None:
    with (
        pytest.raises(errors.RobotError, match="no such pin") as caught,
        errors.translate_errors(KeyError, OSError, to=errors.RobotError),
    ):
        raise OSError("no such pin")
    assert isinstance(caught.value.__cause__, OSError)
