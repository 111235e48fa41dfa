"""A user's scene read, and copied to work in: cameras, materials, what may be seen, what it lacks."""
