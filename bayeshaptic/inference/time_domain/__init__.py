"""Recordings made in closed loop: the motion simulated beside the measured one, and its error."""
