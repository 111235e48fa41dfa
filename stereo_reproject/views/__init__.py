"""Cameras as rays and projections, and how two of them see depth differently. Needs numpy alone."""
