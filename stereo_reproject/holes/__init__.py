"""The target pixels that the warp cannot answer for: a rule per module, and the stage that applies them all."""
