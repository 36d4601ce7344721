"""Input for peers that support only diffuse surfaces."""

from dataclasses import replace

from relume.brdf.albedo import scatters_diffusely
from relume.live.fixed_camera.illumination import Illumination, illumination_from_look
from relume.look import validate
from relume.look.document import default_look
from relume.scene.examples.cornell import cornell_box
from relume.scene.model import Material
from relume_bench.indirect import ignore_glossy_reflection


def light_in(materials: list[Material]) -> Illumination:
    document = default_look(materials)
    return illumination_from_look(
        validate(document, document), [material.name for material in materials], has_bounces=True
    )


def test_glossy_reflection_is_ignored_only_inside_the_context():
    glossy = cornell_box(is_floor_glossy=True).materials
    diffuse = [replace(material, terms=tuple(filter(scatters_diffusely, material.terms))) for material in glossy]
    before = light_in(glossy)
    with ignore_glossy_reflection():
        assert light_in(glossy) == light_in(diffuse)
    assert light_in(glossy) == before != light_in(diffuse)
