"""Blender add-on of relume: send a scene, send its changes, open it, pull the look back. See docs/blender.md.

Blender loads the package under another name, so its modules import each other relatively. Those that import bpy are
`read_*`, `apply_look`, `operators` and `panel`; the others run anywhere.
"""

from __future__ import annotations

from types import ModuleType


def register() -> None:
    """Add operators, panel and settings to Blender."""
    import bpy  # only Blender has it

    from . import operators, panel

    for each in _classes(operators, panel):
        bpy.utils.register_class(each)
    bpy.types.Scene.relume = bpy.props.PointerProperty(type=panel.RelumeSceneSettings)
    bpy.types.WindowManager.relume_status = bpy.props.StringProperty(options={"SKIP_SAVE"})
    bpy.types.WindowManager.relume_omitted = bpy.props.StringProperty(options={"SKIP_SAVE"})


def unregister() -> None:
    """Remove them."""
    import bpy

    from . import operators, panel

    del bpy.types.WindowManager.relume_omitted, bpy.types.WindowManager.relume_status, bpy.types.Scene.relume
    for each in reversed(_classes(operators, panel)):
        bpy.utils.unregister_class(each)


def _classes(operators: ModuleType, panel: ModuleType) -> tuple[type, ...]:
    return (
        panel.RelumePreferences, panel.RelumeSceneSettings, operators.RELUME_OT_send, operators.RELUME_OT_send_changes,
        operators.RELUME_OT_pull, operators.RELUME_OT_open, panel.RELUME_PT_panel,
    )  # fmt: skip
