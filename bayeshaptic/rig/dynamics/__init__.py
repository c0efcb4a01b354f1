"""The mechanics of the bench: structure, plant, forces, time steps."""
