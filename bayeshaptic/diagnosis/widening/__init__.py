"""What widens a limit, or parameters: an unexplained rest, the law of a force, rivals."""
