"""One command each: a frame, an animation, an inspection, a price list, and the comparison."""
