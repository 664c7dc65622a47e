"""A short run of `benchmarks/fuzz_link.py`."""

from benchmarks.fuzz_link import fuzz


def test_mutated_messages_neither_crash_nor_move_the_robot() -> None:
    counts = fuzz(5_000, seed=1)
    assert counts["strangers refused"] == 1_250
    assert counts["connections ended"] > 1_000
    assert counts["understood"] > 10
