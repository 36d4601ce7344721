"""Small glTF files with one defect, and helpers that check their rejection."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from glb_builder import Glb

from relume.assets.environments.environment import Environment
from relume.core.errors import SceneError
from relume.scene.model import Scene
from relume.scene_io.gltf import import_gltf

LIGHT = Environment("white", np.ones((2, 4, 3), np.float32))


def imported(data: bytes) -> Scene:
    return import_gltf(data, "test", LIGHT)


def rejected(data: bytes) -> str:
    with pytest.raises(SceneError) as problem:
        imported(data)
    message = str(problem.value)
    assert "\n" not in message
    assert len(message) < 400
    return message


def changed(**changes: Any) -> bytes:
    """A good file with one top-level member of its document replaced."""
    glb = Glb().quad()
    glb.document.update(changes)
    return glb.bytes()


def with_accessor(**changes: Any) -> bytes:
    """A good file with its position accessor changed."""
    glb = Glb().quad()
    glb.document["accessors"][0].update(changes)
    return glb.bytes()
