"""From masses and links to the sampled response and the motion."""
