"""What is wrong with the samples of a recording, and the recording without it."""
