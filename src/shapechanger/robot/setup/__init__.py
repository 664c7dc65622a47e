"""Setup of a robot: checks, calibration, zeros of joints and tendons, and the systemd unit."""
