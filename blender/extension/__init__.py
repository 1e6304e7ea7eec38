"""What Blender loads: its modules with `bpy` are imported when it is enabled, so that the others need no Blender."""


def register() -> None:
    """Enable the extension; Blender calls it."""
    from . import registration

    registration.register()


def unregister() -> None:
    """Disable the extension; Blender calls it."""
    from . import registration

    registration.unregister()
