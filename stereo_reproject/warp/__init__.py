"""The forward warp from one eye to the other: grid, steps in depth, quads, lookup of colours, mirror images."""
