"""Measurement and refinement of a warped view: probes are placed and traced, their evidence is read by tile, and the tiles are chosen that
must be traced for the frame to keep its promise.

Takes a reprojection (`holes`), a tracer and the accuracy; gives the completed `Target` and its noise ratio.
"""
