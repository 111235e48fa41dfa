"""Stereo Reproject: a stereo pair for little more than the price of one eye.

`import stereo_reproject` needs numpy only; whatever needs Blender lives in `stereo_reproject.blender`. Start
reading at `pipeline.frame.render_stereo_frame`: it is the way of a frame, top to bottom.

Conventions, the same in every file
-----------------------------------
Images     (height, width[, channels]) float32, row 0 at the top. Pixel (i, j) covers [j, j + 1) x [i, i + 1) in
           (x, y); its centre is at (j + 0.5, i + 0.5).
Camera     Blender's: x right, y up, looking along -z. Geometry is computed in float64 and stored in float32.
Depth      distance along the camera's view axis in scene units, > 0; +inf where there is no surface.
Colour     scene-linear, premultiplied by alpha.
Disparity  horizontal shift in pixels, source x minus target x.
Source     the eye that is rendered whole. Target: the eye that is made from it. "Left" and "right" are names that a
           stereo rig gives them; the numeric core does not know which is which.
Transforms are named `a_from_b`, so that neighbours in a product match.
"""
