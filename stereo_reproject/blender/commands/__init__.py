"""The commands, one in each module: a frame, an animation, an inspection, a price list, a comparison."""
