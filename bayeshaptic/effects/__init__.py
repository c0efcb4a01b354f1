"""Physical phenomena that a base model lacks, as things that can be added to it."""
