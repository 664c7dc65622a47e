"""Setup of a robot: calibration, zeros of joints and tendons, and the systemd unit."""
