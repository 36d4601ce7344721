"""The material library: valid terms, the published formulas, and the map of Sun et al. between them."""

from __future__ import annotations

import json
import re
from collections import Counter
from typing import get_args

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from relume.brdf.evaluate import eval_brdf
from relume.brdf.fresnel import fresnel, schlick
from relume.brdf.registry import TERMS
from relume.brdf.term_validation import complete_term
from relume.core.errors import ParameterError
from relume.look.library import MapTable, navigation_map, presets
from relume.look.library.materials import DATA, read_presets
from relume.look.library.merl_fits import CONVERSIONS, GROUPS, convert_all, fit_conductor

# rows of the published tables, for comparisons without the tables
EXAMPLES = {
    "low_cooktorrance_E2": {
        "Lambertian": {"albedo": [0.0031, 0.0044, 0.0024]},
        "LowCookTorrance": {"albedo": [0.1, 0.09, 0.07], "roughness": 0.18, "eta": 3.5},
    },
    "ngan_lafortune": {
        "Lambertian": {"albedo": [0.0145, 0.0332, 0.064]},
        "NganLafortune": {"albedo": [0.0238, 0.0164, 0.01], "Cxy": -0.577, "Cz": 0.5, "sharpness": 40.6},
    },
    "ngan_cooktorrance": {
        "Lambertian": {"albedo": [0.0143, 0.033, 0.0639]},
        "NganCookTorrance": {"albedo": [0.0291, 0.0193, 0.0118], "eta": 0.4, "roughness": 0.2},
    },
    "ngan_ashikhminshirley": {
        "Lambertian": {"albedo": [0.0143, 0.0331, 0.0639]},
        "NganAshikhminShirley": {
            "albedo": [0.0366, 0.0241, 0.0147],
            "fresnelReflectance": 0.0949,
            "sharpness": 116.0,
        },
    },
    "ngan_blinnphong": {
        "Lambertian": {"albedo": [0.0147, 0.0332, 0.064]},
        "NganBlinnPhong": {"albedo": [0.0016, 0.00115, 0.000709], "sharpness": 137.0},
    },
    "ngan_ward": {
        "Lambertian": {"albedo": [0.0138, 0.0326, 0.0636]},
        "NganWard": {"albedo": [0.00774, 0.00547, 0.00339], "roughness": 0.162},
    },
    "ngan_wardduer": {
        "Lambertian": {"albedo": [0.0137, 0.0326, 0.0637]},
        "NganWardDuer": {"albedo": [0.00534, 0.00364, 0.00224], "roughness": 0.162},
    },
}


def pairs(num=400):
    """Directions around the mirror direction and anywhere, none near the horizon."""
    rng = np.random.default_rng(12)
    wo = rng.normal(size=(num, 3)) * [1, 1, 0.3] + [0, 0, 1.2]
    wo[:, 2] = np.abs(wo[:, 2]) + 0.3
    wi = wo * [-1, -1, 1] + rng.normal(size=(num, 3)) * np.geomspace(1e-3, 1, num)[:, None]
    wi[:, 2] = np.abs(wi[:, 2]) + 0.1
    return (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (wi, wo))


def published(table, fit, wi, wo, cook_torrance_fresnel=None):
    """The formulas of Ngan 2005 and Low 2012 for a row of their tables. (n, 3)"""
    lambertian, p = fit.values()
    h = (wi + wo) / np.linalg.norm(wi + wo, axis=1, keepdims=True)
    ni, no, nh, vh = wi[:, 2], wo[:, 2], h[:, 2], np.sum(wo * h, axis=1)
    tan2 = 1 / nh**2 - 1
    masking = np.minimum(1, 2 * nh * np.minimum(ni, no) / vh)
    width = p.get("roughness", 1.0)
    beckmann = np.exp(-tan2 / width**2) / (np.pi * width**2 * nh**4)
    s = p.get("sharpness", 0.0)
    if table == "low_cooktorrance_E2":
        value = np.pi * beckmann * masking * fresnel(vh, p["eta"], 0.0) / (np.pi * ni * no)
    elif table == "ngan_cooktorrance":
        curve = cook_torrance_fresnel or schlick
        value = beckmann * masking * curve(vh, p["eta"]) / (np.pi * ni * no)
    elif table == "ngan_ashikhminshirley":
        value = (s + 1) / (8 * np.pi) * nh**s * schlick(vh, p["fresnelReflectance"]) / (vh * np.maximum(ni, no))
    elif table == "ngan_blinnphong":
        value = (s + 2) / (2 * np.pi) * nh**s
    elif table == "ngan_lafortune":
        c = np.array([p["Cxy"], p["Cxy"], p["Cz"]])
        value = (s + 2) / (2 * np.pi) * (np.maximum((c * wi * wo).sum(axis=1), 0) / np.abs(c).max()) ** s
    else:
        norm = {"ngan_ward": np.sqrt(ni * no), "ngan_wardduer": ni * no}[table]
        value = np.exp(-tan2 / width**2) / (4 * np.pi * width**2 * norm)
    scale = [1.0, 1.15, 1.66] if table.startswith("ngan") else [1.0, 1.0, 1.0]
    return (np.array(lambertian["albedo"]) / np.pi + value[:, None] * np.array(p["albedo"])) * scale


def exact_fresnel(cos_theta_d, f0):
    ior, extinction, gain = fit_conductor(f0)
    return gain * fresnel(cos_theta_d, ior, extinction)


def evaluated(terms, wi, wo):
    return sum(eval_brdf(term, wi, wo) for term in terms)


def assert_is_the_fit(preset, fit):
    table = preset.id.split("/")[0]
    wi, wo = pairs()
    expected = published(table, fit, wi, wo, exact_fresnel)
    # five digits are stored; the last digit of an exponent changes the flank of its peak by more
    np.testing.assert_allclose(evaluated(preset.terms, wi, wo), expected, rtol=2e-3, atol=2e-4 * expected.max())


@pytest.mark.parametrize("table", CONVERSIONS)
def test_a_converted_fit_evaluates_like_its_own_formula(table):
    data = convert_all({name: {"nickel": EXAMPLES[name]} if name == table else {} for name in CONVERSIONS})
    (preset,) = read_presets(data)
    assert (preset.name, preset.group, preset.model) == ("Nickel", "metal", CONVERSIONS[table][0])
    assert_is_the_fit(preset, EXAMPLES[table])


@pytest.mark.parametrize("f0", [0.02, 0.05, 0.2, 0.4, 0.6, 0.8, 0.95, 0.999])
def test_exact_fresnel_is_near_the_fitted_approximation(f0):
    """Within 0.1 up to 80°: no physical curve with this f0 equals Schlick's."""
    cosine = np.cos(np.radians(np.linspace(0, 80, 100)))
    np.testing.assert_allclose(exact_fresnel(cosine, f0), schlick(cosine, f0), atol=0.1)
    assert exact_fresnel(np.array([1.0]), f0)[0] == pytest.approx(f0, rel=1e-9)


@pytest.fixture(scope="module")
def fits(shared_data):
    path = shared_data / "materials" / "fits" / "all_fits.json"
    if not path.is_file():
        pytest.skip("the published tables of fits are not in the shared data")
    return json.loads(path.read_text(encoding="utf-8"))


def test_the_data_file_equals_the_converted_tables(fits):
    assert convert_all(fits) == json.loads(DATA.read_text(encoding="utf-8"))


def test_every_preset_evaluates_like_its_fit(fits):
    for preset in presets():
        table, material = preset.id.split("/")
        assert_is_the_fit(preset, fits[table][material])


def test_every_preset_is_a_valid_part_of_a_look():
    all_presets = presets()
    assert len({preset.id for preset in all_presets}) == len(all_presets) > 600
    for preset in all_presets:
        for term in preset.terms:
            assert complete_term((preset.id,), term, None) == term
        assert preset.group in {*GROUPS, "metal"}
        assert re.fullmatch("#[0-9a-f]{6}", preset.swatch)
        assert preset.terms[1]["model"] == preset.model
        assert preset.source


def test_every_table_and_group_has_presets():
    by_table = Counter(preset.id.split("/")[0] for preset in presets())
    assert set(by_table) == set(CONVERSIONS)
    assert min(by_table.values()) >= 86
    groups = {preset.id.split("/")[1]: preset.group for preset in presets()}
    expected = {"nickel": "metal", "blue-acrylic": "plastic", "pearl-paint": "paint", "pink-felt": "fabric"}
    assert {name: groups[name] for name in expected} == expected
    assert groups["pickled-oak-260"] == "wood"
    assert groups["white-marble"] == "stone"


@pytest.fixture(params=get_args(MapTable))
def plane(request):
    return navigation_map(request.param)


def test_the_map_of_ngan_has_the_metals_of_the_paper():
    """Figure 7 of Sun 2007 shows Ngan's fits; their metals absorb."""
    extinction = {p.id.split("/")[1]: p.terms[1]["params"]["extinction"] for p in navigation_map("ngan").presets}
    assert min(extinction["chrome"], extinction["nickel"]) > 1
    assert all(p.terms[1]["params"]["extinction"] == 0 for p in navigation_map("low").presets)


def test_a_map_point_at_a_material_is_that_material(plane):
    for k in range(0, len(plane.presets), 7):
        expected = plane.presets[k].terms
        for actual, term in zip(plane.at(plane.f0[k], plane.sigma[k]), expected, strict=True):
            np.testing.assert_allclose(actual["color"], term["color"], rtol=1e-6, atol=1e-9)
            for name, value in term["params"].items():
                assert actual["params"][name] == pytest.approx(value, rel=1e-6, abs=1e-6)


def test_colors_and_parameters_between_materials_are_barycentric(plane):
    for triangle in plane.triangles[::9]:
        weights = np.array([0.5, 0.3, 0.2])
        f0 = weights @ plane.f0[triangle]
        sigma = np.exp(weights @ np.log(plane.sigma[triangle]))
        diffuse, highlight = plane.at(f0, sigma)
        for blended, index in ((diffuse, 0), (highlight, 1)):
            colors = np.array([plane.presets[k].terms[index]["color"] for k in triangle])
            np.testing.assert_allclose(blended["color"], weights @ colors, rtol=1e-6, atol=1e-9)
        assert highlight["params"]["sigma"] == pytest.approx(sigma, rel=1e-9)
        ior, extinction = highlight["params"]["ior"], highlight["params"]["extinction"]
        assert abs((ior + 1j * extinction - 1) / (ior + 1j * extinction + 1)) ** 2 == pytest.approx(f0, rel=1e-9)


def test_the_map_triangulates_its_hull_with_one_orientation(plane):
    corners = np.column_stack([plane.f0, np.log(plane.sigma)])[plane.triangles]
    doubled = np.linalg.det(corners[:, 1:] - corners[:, :1])
    assert (doubled > 0).all()
    assert doubled.sum() / 2 == pytest.approx(ConvexHull(corners.reshape(-1, 2)).volume, rel=1e-9)


@pytest.mark.parametrize(("f0", "sigma"), [(2.0, 1e-9), (-1.0, 5.0), (0.3, 1e3), (0.0, 1e-30)])
def test_points_outside_the_map_use_the_nearest_material(plane, f0, sigma):
    terms = plane.at(f0, sigma)
    for term in terms:
        complete_term(("outside",), term, None)
    reached = terms[1]["params"]["sigma"]
    assert plane.sigma.min() * (1 - 1e-9) <= reached <= plane.sigma.max() * (1 + 1e-9)


@pytest.mark.parametrize(("f0", "sigma"), [(np.nan, 0.1), (0.1, 0.0), (0.1, -1.0), (np.inf, 0.1)])
def test_invalid_map_points_are_rejected(f0, sigma):
    with pytest.raises(ParameterError):
        navigation_map("ngan").at(f0, sigma)


def test_parameters_stay_in_range_over_the_whole_map(plane):
    term = TERMS["cook_torrance"]
    for f0 in np.linspace(0, 1, 21):
        for sigma in np.geomspace(0.005, 1, 15):
            for name, value in plane.at(f0, sigma)[1]["params"].items():
                assert term.parameter(name).minimum <= value <= term.parameter(name).maximum
