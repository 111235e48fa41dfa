"""The Blender extension. Nothing is imported here at module level: tools that meet this file outside Blender, pytest
among them, import it as a package."""


def register() -> None:
    from . import operators

    operators.register()


def unregister() -> None:
    from . import operators

    operators.unregister()
