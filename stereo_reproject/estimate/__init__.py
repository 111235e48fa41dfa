"""Measurement and refinement of a warped view.

Probes are placed and traced, their evidence is read tile by tile, and those tiles are chosen that must be traced for
the frame to keep its promise. Takes a reprojection (`holes`), a tracer and the accuracy; gives the completed `Target`
and its estimate.
"""
