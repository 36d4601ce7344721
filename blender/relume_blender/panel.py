"""The panel in the sidebar of the 3D viewport, the settings of a scene, and the preferences.

Blender reads the annotations of properties as values, so they must not become texts.
"""

import textwrap
from typing import Any

import bpy
from bpy.props import EnumProperty, StringProperty

from .operators import omitted_sentences, preferences

_METHODS = [
    ("gather", "Global illumination", "Direct and indirect light, fixed cameras"),
    ("direct", "Direct light only", "Fast, fixed cameras"),
    ("probes", "Free camera", "Orbit freely; approximate while the camera moves"),
]
_PRESETS = [("preview", "Draft", ""), ("good", "Standard", ""), ("final", "Final", "")]
_COLUMNS, _MAX_SENTENCES = 42, 20


class RelumePreferences(bpy.types.AddonPreferences):
    """Server and token; neither is stored in .blend files."""

    bl_idname = __package__

    url: StringProperty(name="Server", default="http://127.0.0.1:8420")  # type: ignore[valid-type]
    token: StringProperty(  # type: ignore[valid-type]
        name="Token", description="Access token, if the server has login", subtype="PASSWORD"
    )

    def draw(self, context: Any) -> None:
        """Draw the two fields."""
        self.layout.prop(self, "url")
        self.layout.prop(self, "token")


class RelumeSceneSettings(bpy.types.PropertyGroup):
    """Settings of a scene, stored in the .blend file."""

    method: EnumProperty(name="Light", items=_METHODS, default="gather")  # type: ignore[valid-type]
    preset: EnumProperty(name="Quality", items=_PRESETS, default="good")  # type: ignore[valid-type]
    look: StringProperty(  # type: ignore[valid-type]
        name="Look", description="Name of a saved look, or a share link; empty for the look that was saved last"
    )
    sent: StringProperty()  # type: ignore[valid-type]


class RELUME_PT_panel(bpy.types.Panel):  # noqa: N801 - Blender's convention
    """Operators, status, and what was left out."""

    bl_label, bl_category, bl_space_type, bl_region_type = "relume", "relume", "VIEW_3D", "UI"

    def draw(self, context: Any) -> None:
        """Draw the panel."""
        layout, settings = self.layout, context.scene.relume
        layout.prop(preferences(context), "url")
        layout.prop(settings, "method")
        layout.prop(settings, "preset")
        layout.operator("relume.send", icon="EXPORT")
        layout.operator("relume.send_changes", icon="FILE_REFRESH")
        layout.operator("relume.open", icon="URL")
        layout.prop(settings, "look")
        layout.operator("relume.pull", icon="IMPORT")
        manager = context.window_manager
        if manager.relume_status:
            _draw_text(layout.box(), manager.relume_status)
        sentences = omitted_sentences(context)
        if sentences:
            box = layout.box()
            box.label(text="Left out", icon="INFO")
            for sentence in sentences[:_MAX_SENTENCES]:
                _draw_text(box, sentence)
            if len(sentences) > _MAX_SENTENCES:
                box.label(text=f"… and {len(sentences) - _MAX_SENTENCES} more")


def _draw_text(layout: Any, text: str) -> None:
    column = layout.column(align=True)
    for line in textwrap.wrap(text, _COLUMNS):
        column.label(text=line)
