"""Pictures as arrays, and all that can be done with one picture, or with two of the same view, by NumPy alone.

The room takes passes by name, (H, W, C) each, from EXR files or from a renderer. It gives them back filtered, looked up
or denoised, and gives what they show: contrast, effects and materials, samples, error and noise. It also holds the
words that higher rooms share: names of passes, reasons and effects. It knows no camera and no Blender.
"""
