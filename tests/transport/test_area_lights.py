"""Area lights in narrow lobes against a fine quadrature over their surface, and the strata of their samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy_reference as ref
import pytest
from tiny_scenes import make_emissive_triangles

from relume.brdf.curves import curve_bands
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.lights.light_sampling import NOT_FLAT_RADIUS, make_strata, split_axes
from relume.lights.local_lights import make_emitter_parts, make_light_strata, prepare_local_lights, rectangle
from relume.lights.spherical_triangles import NO_LIGHTS
from relume.live.opened.local_lights import FINE_SAMPLE_FACTOR, SAMPLES
from relume.look import LightGeometry
from relume.raytrace.embree import EmbreeScene
from relume.raytrace.local_light_visibility import trace_light_visibility
from relume.raytrace.surface_points import SurfacePoints
from relume.transport.projector import Projector
from relume.transport.shading.shader import Shader
from relume.transport.shading_points import LocalRays, ShadingPoints
from relume.transport.term_contraction import contract

PANEL = LightGeometry("rectangle", (0.1, 1.4, -0.8), (0.1, -1.0, 0.3), rotation=20.0, size=(0.9, 0.5))
MESH = LightGeometry("mesh", material="Lamp")
SIDE = 10
ROOM = {"ggx": {"roughness": 0.1}, "cook_torrance": {"sigma": 0.1}, "ward_anisotropic": {}}
FINE = {
    "ggx": 150,
    "cook_torrance": 80,
    "ward_anisotropic": 80,
}  # points per side; error 0.3 % for the first, 0.04 % for others


def floor_under(light, *, is_visible=True):
    """A floor with the camera above; all samples of an area light are visible, or none."""
    x, z = (a.ravel() for a in np.meshgrid(np.linspace(-1, 1, SIDE), np.linspace(-1.2, 1.2, SIDE)))
    position = np.stack([x, 0 * x, z], axis=1)
    normal, tangent = (np.tile(np.array(axis, np.float32), (len(x), 1)) for axis in ([0, 1, 0], [1, 0, 0]))
    wo = ref.unit(np.array([0, 1.5, 3.0]) - position).astype(np.float32)
    strata = make_light_strata(light, 64)
    visible = np.full((len(x), len(strata.uv) // 8), 255 if is_visible else 0, np.uint8)
    points = SurfacePoints(position.astype(np.float32), normal, tangent, np.arange(len(x), dtype=np.uint32))
    rays = LocalRays(light, strata, np.ones(3, np.float32), visible)
    return ShadingPoints(points, wo, np.empty((len(x), 0), np.uint8), (rays,))


def curves_of(model, params):
    document = complete_term(("test",), {"model": model, "params": params}, None)
    return TERMS[model].normalized(document), {c.name: curve_bands(document, c) for c in TERMS[model].curves}


def by_quadrature(term, bands, receivers, fine):
    """Radiance of a floor under `PANEL`: the mean over many positions at exact angles. (n, 3)"""
    corner, (e, f) = rectangle(PANEL)
    step = (np.arange(fine) + 0.5) / fine
    positions = corner + (step[:, None, None] * e + step[:, None] * f).reshape(-1, 3)
    normal = np.cross(e, f)
    out = []
    for position, wo in zip(receivers.points.position.astype(float), receivers.wo.astype(float), strict=True):
        away = positions - position
        squared = (away**2).sum(axis=1)
        x, y, z = ref.unit(away).T
        wi, o = np.stack([x, -z, y], axis=1), np.array([wo[0], -wo[2], wo[1]])
        weight = np.maximum(-ref.unit(away) @ normal, 0) / squared / fine**2 * y
        value = weight[:, None] * term.quotients(*wi.T, *(np.full(len(wi), c) for c in o)).T
        for curve in term.curves:
            if not curve.depends_on_view:
                value = value * bands[curve.name][:, ref.find_bands(curve, wi, o)].T
        out.append(value.sum(axis=0))
    return np.array(out)


def error(actual, expected):
    """Relative RMSE."""
    return np.sqrt(np.square(actual - expected).mean() / np.square(expected).mean())


@pytest.mark.parametrize("model", ROOM)
def test_area_lights_have_no_noise_in_narrow_lobes(model):
    """Samples without extent have an error of 37 % in the first case."""
    term, bands = curves_of(model, ROOM[model])
    receivers = floor_under(prepare_local_lights(PANEL))
    expected = by_quadrature(term, bands, receivers, FINE[model])
    radiance = Shader(term, contract(term, bands, None), NO_LIGHTS, receivers).project(0, SIDE**2)[:, 0]
    assert error(radiance, expected) < 0.01
    for active in (c.name for c in term.curves if not c.depends_on_view):
        transport = Projector(term, contract(term, bands, active), NO_LIGHTS, receivers).project(0, SIDE**2)
        assert error(np.einsum("njc,cj->nc", transport.astype(float), bands[active]), expected) < 0.01


def test_an_occluded_light_gives_nothing():
    term, bands = curves_of("ggx", {})
    hidden = floor_under(prepare_local_lights(PANEL), is_visible=False)
    assert not Shader(term, contract(term, bands, None), NO_LIGHTS, hidden).project(0, SIDE**2).any()


def test_with_other_light_an_area_light_is_sampled_coarser():
    """Within 0.1 % of all light; the other light is in neither."""
    term, bands = curves_of("ggx", ROOM["ggx"])
    contraction, receivers = contract(term, bands, None), floor_under(prepare_local_lights(PANEL))
    beside = np.full((SIDE**2, 3), 2.0, np.float32)
    alone = Shader(term, contraction, NO_LIGHTS, receivers).project(0, SIDE**2)[:, 0]
    radiance = Shader(term, contraction, NO_LIGHTS, receivers, beside).project(0, SIDE**2)[:, 0]
    away = np.abs(radiance - alone)
    assert 1e-6 < away.max() < 1e-3 * (2 + alone.max())


def panel_in(columns, rows, begin=0.0, end=1.0):
    """Triangles of the panel from `begin` to `end` of its width. (2 columns · rows, 3, 3)"""
    corner, (e, f) = rectangle(PANEL)
    corner = corner + begin * e
    e, f, triangles = (end - begin) * e / columns, f / rows, []
    for a in (corner + k * e + m * f for k in range(columns) for m in range(rows)):
        triangles += [[a, a + e, a + e + f], [a, a + e + f, a + f]]
    return np.array(triangles)


@pytest.mark.parametrize(
    ("columns", "rows", "roughness", "max_error"), [(1, 1, 0.1, 0.01), (4, 1, 0.1, 0.02), (24, 16, 0.3, 0.05)]
)
def test_a_mesh_light_equals_the_panel(columns, rows, roughness, max_error):
    """Strata of several pieces overlap and leave gaps that a narrower lobe would resolve."""
    term, bands = curves_of("ggx", {"roughness": roughness})
    mesh = prepare_local_lights(MESH, make_emissive_triangles(panel_in(columns, rows), False))
    expected, actual = (
        Shader(term, contract(term, bands, None), NO_LIGHTS, floor_under(light)).project(0, SIDE**2)[:, 0]
        for light in (prepare_local_lights(PANEL), mesh)
    )
    assert error(actual, expected) < max_error


def test_a_partly_occluded_light_is_reflected():
    """A fifth of a panel behind an opening, against a panel of that width; 43 % off with a quarter of the samples."""
    term, bands = curves_of("ggx", {"roughness": 0.1})
    wall = np.concatenate([panel_in(1, 1, -2.5, 0), panel_in(1, 1, 1, 3.3)]).reshape(-1, 3)
    wall += 1e-3 * np.array(PANEL.direction)
    blocks = EmbreeScene.build(wall.astype(np.float32), np.arange(12, dtype=np.uint32).reshape(4, 3))
    open_air, behind = (
        prepare_local_lights(MESH, make_emissive_triangles(panel_in(1, 1, *ends), False))
        for ends in ((0, 1), (-2.3, 3.1))
    )
    of_panel, strata = floor_under(open_air), make_light_strata(behind, FINE_SAMPLE_FACTOR * SAMPLES)
    visibility = trace_light_visibility(blocks, behind, strata, of_panel.points)
    lit = replace(of_panel, rays=(LocalRays(behind, strata, np.ones(3, np.float32), visibility),))
    expected, actual = (
        Shader(term, contract(term, bands, None), NO_LIGHTS, receivers).project(0, SIDE**2)[:, 0]
        for receivers in (of_panel, lit)
    )
    assert error(actual, expected) < 0.05


@pytest.mark.parametrize(("num_pieces", "num"), [(1, 64), (2, 256), (50, 256), (1000, 256), (3, 4), (1, 1)])
def test_every_stratum_row_and_column_has_samples(num_pieces, num):
    """For any shift within strata, each N-th of u and, without shift, of v has one sample."""
    strata = make_strata(split_axes(num_pieces, num), 1)
    uv = strata.corner + strata.size * strata.uv
    for axis in range(2):
        np.testing.assert_array_equal(np.sort((uv[:, axis] * num).astype(int)), np.arange(num))
    assert len(np.unique(strata.corner, axis=0)) == num


def test_strata_that_are_not_flat_use_single_samples():
    """A box of twelve triangles: none of its coarse strata is a quadrilateral."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    sides = [corners, corners[:, [1, 2, 0]], corners[:, [2, 0, 1]]]
    faces = [f for side in sides for f in (side, side[::-1] + np.cross(*np.diff(side, axis=0)[:2]))]
    triangles = np.array([t for f in faces for t in (f[[0, 1, 2]], f[[0, 2, 3]])])
    light = prepare_local_lights(MESH, make_emissive_triangles(triangles, True))
    parts = make_emitter_parts(light, make_light_strata(light, 64))
    assert np.all(parts.radius[:5] == NOT_FLAT_RADIUS)
    assert 0.3 < np.mean(parts.radius[85:] < 1) < 1
