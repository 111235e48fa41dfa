"""The way of a frame, from the rendered source to the finished pair, and the predictions around it. Start at `frame`.

Takes a `Renderer` and the settings; gives a `StereoFrame`.
"""
