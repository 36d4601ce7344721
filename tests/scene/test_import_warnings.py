"""Import warnings and their effect on the image."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import numpy as np

from relume.assets.environments.environment import Environment
from relume.core.import_warnings import approximated, ignored, unsupported, warning_of
from relume.scene.finalize import MAX_WARNINGS, finalize
from relume.scene.model import Scene
from relume.scene.scene_folder import load_scene, save_scene
from relume.scene_io.import_scene import import_scene

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nl 1 2\nmtllib none.mtl\nf 1 2 3\n"


def imported() -> Scene:
    return import_scene(TRIANGLE.encode(), "test", LIGHT)


def test_warnings_are_sorted_by_severity() -> None:
    assert [(warning.severity, str(warning)) for warning in imported().warnings] == [
        ("unsupported", "Missing material file “none.mtl”: import it together with the scene."),
        ("ignored", "The file's lines aren't supported; only faces are shown."),
    ]


def test_effects_are_stored_with_the_scene(tmp_path: Path) -> None:
    scene = imported()
    save_scene(scene, tmp_path)
    loaded = load_scene(tmp_path)
    assert [(warning.severity, warning) for warning in loaded.warnings] == [
        (warning.severity, warning) for warning in scene.warnings
    ]


def test_scenes_without_effects_still_open(tmp_path: Path) -> None:
    save_scene(imported(), tmp_path)
    document = json.loads((tmp_path / "scene.json").read_text())
    document["warnings"] = ["something is off"]
    (tmp_path / "scene.json").write_text(json.dumps(document))
    (warning,) = load_scene(tmp_path).warnings
    assert (warning, warning.severity) == ("something is off", "unsupported")


def test_long_lists_omit_the_least_severe_warnings() -> None:
    scene = imported()
    warnings = [ignored("a little thing")] * MAX_WARNINGS + [approximated("a mean")] * 3 + [unsupported("a hole")]
    listed = finalize("test", scene.meshes, scene.materials, scene.cameras, LIGHT, warnings).warnings
    assert listed[:4] == ("a hole", "a mean", "a mean", "a mean")
    assert (listed[-1], listed[-1].severity, len(listed)) == ("… and 4 more.", "ignored", MAX_WARNINGS + 1)


def test_a_warning_survives_serialization_and_pickling() -> None:
    import_warning = approximated("a mean")
    for copy in (
        warning_of(json.loads(json.dumps(import_warning.document()))),
        pickle.loads(pickle.dumps(import_warning)),
    ):
        assert (copy, copy.severity) == (import_warning, import_warning.severity)
