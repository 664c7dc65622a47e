"""Generated from mujoco 4.0.0 by scripts/generate_stubs.py; do not edit."""

