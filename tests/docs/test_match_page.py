"""The look and the requests of docs/guide/match.md are valid, and fit the built-in still life."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from relume.inverse_lighting.sources import source_lights
from relume.look import default_look, validate
from relume.scene.examples.catalog import built_in
from relume_server.schemas.solve import SolveRequest

PAGE = Path(__file__).resolve().parents[2] / "docs" / "guide" / "match.md"
WIDTH, HEIGHT = 320, 240


def documents(kind: str) -> list[dict[str, Any]]:
    """Documents of the page with a field."""
    texts = re.findall(r"```json\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    return [document for document in map(json.loads, texts) if kind in document]


@pytest.fixture(scope="module")
def default() -> dict[str, Any]:
    scene = built_in("still_life")
    return default_look(scene.materials, scene.lights)


def test_the_looks_are_valid(default: dict[str, Any]) -> None:
    first, evening = documents("lights")
    lights = {name: {**fields, **evening["lights"][name]} for name, fields in first["lights"].items()}
    assert validate(first, default).lights["Fill"].intensity == 3.0
    assert validate({**evening, "lights": lights}, default).environment.intensity == 0.03


def test_the_requests_are_valid_and_name_what_is_there(default: dict[str, Any]) -> None:
    look = validate(documents("lights")[0], default)
    requests = documents("strokes")
    assert len(requests) == 4
    for fields in requests:
        request = SolveRequest.model_validate({"bake": "0" * 16, "view": "front", **fields})
        assert set(request.locked) <= set(source_lights(look))
        assert set(request.materials) <= set(look.materials)
        for x, y in (point for stroke in request.strokes for point in stroke.points):
            assert 0 <= x < WIDTH
            assert 0 <= y < HEIGHT
