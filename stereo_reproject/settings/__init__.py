"""Settings that the user asks for, checked once and frozen.

It takes values from the command line, a script or the panel and gives `StereoSettings` (a pair), `Accuracy` (what is
promised and traced for it) and `AnimationSettings` (many frames). Wrong values raise BadInputError.
"""
