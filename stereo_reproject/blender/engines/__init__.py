"""Renders of a working scene by Blender: whole views, pixels traced packed or behind a card, denoising, EEVEE."""
