"""The warp on a GPU: its shaders, its textures, and whether there is a GPU that works.

Takes what NumPy's warp takes and gives the same `WarpedView`; whatever a GPU cannot do is left to NumPy.
"""
