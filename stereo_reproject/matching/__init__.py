"""Light of two engines made to agree: pixels that one has traced are given the light of a picture by another.

The room takes a picture, the colours and surfaces that a tracer has found at the holes and at a ring around them, and
which pixels of the picture may be believed. It gives the colours of those pixels, matched to the picture
(`matching.match`).
"""
