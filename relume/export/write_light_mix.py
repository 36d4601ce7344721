"""Writes the light mix of a look as JSON, see `relume.look.light_mix`."""

from __future__ import annotations

import json
from pathlib import Path

from relume.core.filesystem import atomic_write
from relume.core.validation import names_text
from relume.export.export_document import ExportDocument
from relume.look import default_look, validate
from relume.look.light_mix import make_light_mix


def write_light_mix(export: ExportDocument, path: Path) -> None:
    """Write the light mix of an export's look. Raises RelumeError if the file cannot be written."""
    mix = make_light_mix(export.look, export.scene.name)
    with atomic_write(path) as file:
        file.write_text(json.dumps(mix, indent=2) + "\n", encoding="utf-8")


def omitted_from_light_mix(export: ExportDocument) -> tuple[str, ...]:
    """Return sentences about lights that the mix does not restore on the scene."""
    default = default_look(export.scene.materials, export.scene.lights)
    scene_lights, lights = validate({}, default).lights, export.look.lights
    added = lights.keys() - scene_lights.keys()
    moved = {name for name in lights.keys() - added if lights[name].geometry != scene_lights[name].geometry}
    sentences = {
        f"Lights that the look adds have their values, but not their places: {names_text(added)}.": bool(added),
        f"Position, shape, image and links of these lights stay those of the scene: {names_text(moved)}.": bool(moved),
        "A light mix has the lights of one look; further looks are left out.": bool(export.variants),
    }
    return tuple(sentence for sentence, applies in sentences.items() if applies)
