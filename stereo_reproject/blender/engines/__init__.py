"""Renders of a working scene: whole views, packed or masked holes, denoising, EEVEE."""
