"""Effects of forces that are not linear in the motion, and of actuators that are not linear."""
