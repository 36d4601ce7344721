"""Materials matched together with the lights: those that made a picture come back."""

from __future__ import annotations

import numpy as np
import pytest
from matched_looks import matched, relative_error
from session_edits import make_look

from relume.brdf.registry import TERMS
from relume.core.errors import ParameterError
from relume.image_io.write_image import write_image
from relume.inverse_lighting.match_look import MatchRequest, match_look
from relume.inverse_lighting.match_materials import MAX_STEPS
from relume.inverse_lighting.material_parameters import (
    MAX_PARAMETERS,
    material_parameters,
    positions_of,
    with_positions,
)
from relume.inverse_lighting.painting import Stroke, painted_target
from relume.inverse_lighting.report import residual
from relume.inverse_lighting.solve import Target

KEY = {"kind": "point", "position": [0.5, 1.3, 0.5], "emission": [2.0, 1.5, 1.0]}
SIZE = WIDTH, HEIGHT = 40, 30


def look_of(transfer, *, key=1.0, red=(0.8, 0.1, 0.1), exponent=30.0):
    """A look with a light, the color of the red wall, and the width of the floor's highlight."""

    def change(document):
        document["lights"]["Key"] = {**KEY, "intensity": key}
        document["materials"]["Red"]["terms"][0]["color"] = list(red)
        document["materials"]["Floor"]["terms"][1]["params"]["exponent"] = exponent

    return make_look(transfer, change)


def picture_request(image, folder, **fields):
    """A request with an image as the reference picture."""
    write_image(folder / "a.exr", image.astype(np.float32))
    return MatchRequest(reference=(folder / "a.exr").read_bytes(), **fields)


@pytest.mark.parametrize("noise", [0.0, pytest.param(0.02, marks=pytest.mark.slow)])
def test_lights_and_two_materials_of_a_picture_come_back(gathered, render, tmp_path, noise):
    look, wanted = look_of(gathered), look_of(gathered, key=3.0, red=(0.2, 0.4, 0.6), exponent=80.0)
    picture = render(wanted)
    noisy = picture * (1 + noise * np.random.default_rng(0).standard_normal(picture.shape))
    names = frozenset({"Red", "Floor"})
    result = match_look(look, render, render, SIZE, picture_request(noisy, tmp_path, materials=names))
    after = matched(look, result)
    assert relative_error(render(after), picture) < (0.01 if noise == 0.0 else 0.03)
    assert result.match.residual_before == pytest.approx(relative_residual(render, look, noisy), rel=0.1)
    assert result.materials == ("Floor", "Red")
    np.testing.assert_allclose(after.materials["Red"].terms[0]["color"], (0.2, 0.4, 0.6), atol=0.05)
    without = match_look(look, render, render, SIZE, picture_request(noisy, tmp_path))
    assert without.materials == ()
    assert without.match.residual > 5 * max(result.match.residual - noise, 0.005)


def relative_residual(render, look, picture):
    """Residual of a look, with the weights of a reference picture."""
    target = painted_target([], picture, Target(picture, np.ones(picture.shape[:2], np.float32))).target
    return residual(render(look), picture, target.weights)


def test_locked_lights_determine_the_color_of_a_material_by_few_renders(gathered, render, tmp_path):
    look, wanted, num_renders = look_of(gathered), look_of(gathered, red=(0.3, 0.2, 0.7)), 0

    def counted(each):
        nonlocal num_renders
        num_renders += 1
        return render(each)

    request = picture_request(
        render(wanted), tmp_path, materials=frozenset({"Red"}), locked=frozenset({"/environment", "/lights/Key"})
    )
    result = match_look(look, counted, render, SIZE, request)
    np.testing.assert_allclose(matched(look, result).materials["Red"].terms[0]["color"], (0.3, 0.2, 0.7), atol=0.01)
    assert [operation["path"] for operation in result.operations] == ["/materials/Red/terms"]
    assert result.match.residual < 0.01
    num_sources, num_parameters = 2, 3
    assert num_parameters < num_renders <= (MAX_STEPS + 3) * (num_sources + num_parameters + 1)


def test_a_stroke_changes_a_material_that_only_it_can(gathered, render):
    """The lights are locked: the red wall itself becomes darker."""
    look, mask = look_of(gathered), np.zeros((HEIGHT, WIDTH), np.float32)
    mask[8:20, 2:8] = 1.0
    request = MatchRequest(
        lambda size: [Stroke("darker", mask)],
        materials=frozenset({"Red"}),
        locked=frozenset({"/environment", "/lights/Key"}),
        changes_color=False,
    )
    result = match_look(look, render, render, SIZE, request)
    ratio = render(matched(look, result))[mask > 0].mean() / render(look)[mask > 0].mean()
    assert ratio == pytest.approx(0.5, abs=0.05)
    assert result.match.shortfalls == ()


def test_materials_that_are_not_named_stay(gathered, render, tmp_path):
    look, wanted = look_of(gathered), look_of(gathered, red=(0.2, 0.4, 0.6))
    result = match_look(
        look, render, render, SIZE, picture_request(render(wanted), tmp_path, materials=frozenset({"Blue"}))
    )
    after = matched(look, result)
    assert after.materials["Red"] == look.materials["Red"]
    assert after.materials["Floor"] == look.materials["Floor"]


def test_without_a_target_materials_stay(gathered, render):
    result = match_look(look_of(gathered), render, render, SIZE, MatchRequest(materials=frozenset({"Red"})))
    assert (result.operations, result.materials) == ([], ())


def test_positions_are_those_of_the_sliders(gathered):
    look = look_of(gathered, exponent=30.0)
    parameters = material_parameters(look, {"Floor"})
    assert [(each.term, each.name, each.channel) for each in parameters] == [
        (0, "color", 0), (0, "color", 1), (0, "color", 2),
        (1, "color", 0), (1, "color", 1), (1, "color", 2), (1, "exponent", None),
    ]  # fmt: skip
    positions = positions_of(look, parameters)
    np.testing.assert_allclose(positions[:6], [0.7, 0.7, 0.7, 0.12, 0.12, 0.12])
    exponent = TERMS["blinn_phong"].parameter("exponent")
    assert positions[6] == pytest.approx(np.log(30.0 / exponent.minimum) / np.log(exponent.maximum / exponent.minimum))
    after = with_positions(look, parameters, np.ones(7)).materials["Floor"].terms
    assert (after[0]["color"], after[1]["params"]["exponent"]) == ((1.0, 1.0, 1.0), exponent.maximum)
    assert with_positions(look, parameters, positions).materials["Red"] == look.materials["Red"]


def test_parameters_per_channel_are_three_numbers(gathered):
    def change(document):
        document["materials"]["Blue"]["terms"] = [{"model": "ggx", "params": {"f0": [0.9, 0.5, 0.1]}}]

    look = make_look(gathered, change)
    parameters = material_parameters(look, {"Blue"})
    assert [each.channel for each in parameters if each.name == "f0"] == [0, 1, 2]
    moved = with_positions(look, parameters[-1:], np.array([0.3])).materials["Blue"].terms[0]["params"]["f0"]
    assert moved == pytest.approx((0.9, 0.5, 0.3))


def test_parameters_of_the_operator_stay(gathered):
    def change(document):
        document["materials"]["Blue"]["terms"] = [{"model": "ward_anisotropic"}]

    names = {each.name for each in material_parameters(make_look(gathered, change), {"Blue"})}
    assert names.isdisjoint(TERMS["ward_anisotropic"].fixed)


def test_unknown_empty_and_too_many_materials_are_errors(gathered):
    look = look_of(gathered)
    with pytest.raises(ParameterError, match="Blue"):
        material_parameters(look, {"Ghost"})
    empty = look.materials["Red"].model_copy(update={"terms": ()})
    with pytest.raises(ParameterError, match="leave this one out"):
        material_parameters(look.model_copy(update={"materials": {**look.materials, "Red": empty}}), {"Red"})
    large = look.materials["Red"].model_copy(update={"terms": look.materials["Red"].terms * (MAX_PARAMETERS // 3 + 1)})
    with pytest.raises(ParameterError, match="name fewer"):
        material_parameters(look.model_copy(update={"materials": {**look.materials, "Red": large}}), {"Red"})
