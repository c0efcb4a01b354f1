"""Effects of linear dynamics: more masses, springs, poles, delay."""
