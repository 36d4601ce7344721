"""Scenes and blots of the figures of moving free cameras."""

import numpy as np
import pytest

from relume.scene.examples.catalog import BUILT_IN, built_in
from relume_bench.free_camera_accuracy import (
    FreeCameraSizes,
    count_blots,
    make_rough_scene,
    make_rough_terms,
    summarize,
)

LAMBERT = {"model": "lambert", "color": [0.9, 0.2, 0.1]}


def test_rough_materials_keep_their_colors_and_lose_sharp_highlights() -> None:
    metal = {"model": "ggx", "color": [1.0, 0.9, 0.8], "params": {"roughness": 0.1, "f0": 0.95}}
    assert make_rough_terms([LAMBERT]) == ({"model": "lambert", "color": [0.8, 0.2, 0.1]},)
    (rough,) = make_rough_terms([metal])
    assert rough == {**metal, "params": {"roughness": 0.5, "f0": 0.95}}
    wide = {**metal, "params": {"roughness": 0.7, "f0": 0.95}}
    assert make_rough_terms([wide]) == (wide,)
    phong = {"model": "phong", "color": [0.3, 0.3, 0.3], "params": {"exponent": 200.0}}
    assert [term["model"] for term in make_rough_terms([LAMBERT, phong])] == ["lambert", "ggx"]


@pytest.mark.parametrize("name", BUILT_IN)
def test_rough_scenes_have_all_surfaces_and_their_mesh_lights(name: str) -> None:
    scene = built_in(name)
    rough = make_rough_scene(scene, scene.cameras[0])
    assert [mesh.name for mesh in rough.meshes] == [mesh.name for mesh in scene.meshes]
    assert [light.name for light in rough.lights] == (["Lamp"] if name == "lamplit_cornell_box" else [])
    assert not any(material.textures or material.is_alpha_tested for material in rough.materials)


def test_blots_are_three_times_brighter_or_darker_where_it_is_not_black() -> None:
    exact = np.ones((100, 3))
    exact[:10] = 1e-5
    image = exact.copy()
    image[:10] *= 50  # still black
    image[20:22] *= 3.2
    image[30:33] /= 3.2
    image[40:50] *= 2.9
    assert count_blots(image, exact) == 5
    assert count_blots(exact, exact) == 0


def test_figures_are_of_all_images() -> None:
    images = {
        f"scene, {k}": {"rmse": rmse, "surface_pixels": 100, "blot_pixels": blots}
        for k, (rmse, blots) in enumerate([(0.02, 0), (0.05, 1), (0.2, 5)])
    }
    median, worst, blots = summarize(images, {"broken": "ValueError"}, FreeCameraSizes.choose(True))
    assert (median.value, worst.value, blots.value) == pytest.approx((5, 20, 2))
    assert (worst.context["image"], blots.context["worst_image"]) == ("scene, 2", 5)
    assert median.context["failed"] == {"broken": "ValueError"}
    with pytest.raises(ValueError, match="no scene"):
        summarize({}, {"broken": "ValueError"}, FreeCameraSizes.choose(True))
