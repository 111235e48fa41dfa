"""The warp on a GPU: shaders, textures, and where a GPU is to be had."""
