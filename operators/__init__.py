"""The artist's surface: properties, operators and panels."""

# In the order in which Blender must meet them: a property group before what points to it.
classes: tuple[type, ...] = ()


def register() -> None:
    import bpy

    for cls in classes:
        bpy.utils.register_class(cls)


def unregister() -> None:
    import bpy

    for cls in reversed(classes):
        bpy.utils.unregister_class(cls)
