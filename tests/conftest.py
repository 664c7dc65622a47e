"""What holds for all tests."""

from hypothesis import settings

# No test asserts a wall-clock time: a busy machine is no defect.
settings.register_profile("shapechanger", deadline=None)
settings.load_profile("shapechanger")
