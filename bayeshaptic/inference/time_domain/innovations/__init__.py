"""A Kalman filter beside one mass: what it cannot foresee of the measured motion."""
