"""What was asked for, checked once and frozen: of a frame, of its accuracy, and of an animation."""
