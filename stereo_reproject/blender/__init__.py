"""The package's only Blender code: scenes become numbers here, and numbers become pictures."""
