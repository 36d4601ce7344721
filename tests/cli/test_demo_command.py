"""The bake of `relume demo` and the curve that the editor opens first."""

from __future__ import annotations

from pathlib import Path

from fastapi.testclient import TestClient

from relume.brdf.registry import TERMS
from relume.scene.examples.still_life import demo_scene
from relume_cli.demo import SELECTED, demo_recipes
from relume_server.app import create_app
from relume_server.settings import Settings
from relume_worker.status import bake_id


def test_demo_bakes_the_view_that_the_editor_opens(tmp_path: Path) -> None:
    app = create_app(Settings(data=tmp_path, preload_importer=False, prewarm=False))
    with TestClient(app, "http://127.0.0.1") as client:
        scene = client.post("/api/example-scenes/still_life").json()
        request = {"scene": scene["id"], "method": "gather", "views": [view["name"] for view in scene["views"]]}
        for recipe, preset in zip(demo_recipes(demo_scene()), ("preview", "good"), strict=True):
            asked = client.post("/api/bakes", json=request | {"preset": preset, "dry_run": True})
            assert asked.json()["id"] == bake_id(scene["id"], recipe)


def test_demo_opens_a_curve_of_its_scene() -> None:
    (material,) = (each for each in demo_scene().materials if each.name == SELECTED["material"])
    term = material.terms[int(SELECTED["term"])]
    assert SELECTED["curve"] in [curve.name for curve in TERMS[term["model"]].curves]
