"""Views of a scene: cameras as rays and projections, their motion, and how two of them see a depth differently.

Takes view planes, poses and lenses, as numbers; gives places in pixels, depths and disparities. Needs NumPy alone.
"""
