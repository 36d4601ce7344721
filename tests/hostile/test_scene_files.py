"""Scene files with random changed bytes, and real broken ones, give one clear SceneError, and nothing hangs."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from glb_builder import Glb, self_contained
from hostile_scenes import LIGHT, imported
from hypothesis import given, settings
from hypothesis import strategies as st

from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.import_scene import import_scene


@settings(max_examples=300)
@given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(0, 255)), min_size=1, max_size=12))
def test_import_survives_any_changed_bytes(changes: list[tuple[float, int]]) -> None:
    data = bytearray(FUZZED)
    for offset, value in changes:
        data[int(offset * len(data))] = value
    try:
        scene = imported(bytes(data))
    except SceneError:
        return
    assert isinstance(scene, Scene)


def _rich_file() -> bytes:
    glb = Glb()
    texture = glb.texture(np.arange(48).reshape(4, 4, 3))
    glb.quad({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}, "normalTexture": {"index": texture}})
    glb.document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.5}}]
    glb.document["nodes"].append({"camera": 0, "translation": [0, 0, 5]})
    glb.document["scenes"][0]["nodes"].append(1)
    return glb.bytes()


FUZZED = _rich_file()


def test_the_unchanged_file_is_valid() -> None:
    scene = imported(FUZZED)
    assert [camera.name for camera in scene.cameras] == ["camera"]
    assert scene.warnings == ()


@pytest.mark.parametrize(
    ("folder", "step"),
    [("conformance", 4), ("bad-inputs", 1), pytest.param("conformance", 1, marks=pytest.mark.slow)],
)
def test_every_file_is_imported_or_refused(shared_data: Path, folder: str, step: int) -> None:
    files = [p for p in sorted((shared_data / folder).rglob("*")) if p.suffix in (".glb", ".gltf")][::step]
    assert len(files) > 25
    num_imported, messages = 0, []
    for path in files:
        for data in {path.read_bytes(), self_contained(path) if path.suffix == ".gltf" else b""} - {b""}:
            try:
                imported(data)
                num_imported += 1
            except SceneError as problem:
                messages.append(str(problem))
    assert num_imported > 0
    assert messages
    assert not [message for message in messages if "\n" in message or len(message) > 400]


def test_refused_messages_show_no_path(tmp_path: Path) -> None:
    broken = tmp_path / "broken.glb"
    broken.write_bytes(json.dumps({"asset": 1}).encode())
    with pytest.raises(SceneError) as problem:
        import_scene(broken, "test", LIGHT)
    assert str(tmp_path) not in str(problem.value)
