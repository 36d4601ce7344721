"""What peers that know diffuse surfaces alone are compared with."""

from dataclasses import replace

from bench.indirect import highlights_send_nothing
from relume.brdf.albedo import is_diffuse
from relume.look import validate
from relume.look.document import default_look
from relume.picture.light import Light, light_of
from relume.scene.cornell import cornell_box
from relume.scene.model import Material


def light_in(materials: list[Material]) -> Light:
    document = default_look(materials)
    return light_of(validate(document, document), [one.name for one in materials], has_bounces=True)


def test_highlights_send_nothing_inside_and_what_they_do_after():
    glossy = cornell_box(is_floor_glossy=True).materials
    diffuse = [replace(one, terms=tuple(filter(is_diffuse, one.terms))) for one in glossy]
    before = light_in(glossy)
    with highlights_send_nothing():
        assert light_in(glossy) == light_in(diffuse)
    assert light_in(glossy) == before != light_in(diffuse)
