"""Measurements of other layouts than MERL: RGL tensor files and Cornell's scattered values, on the MERL grid."""

import math
import struct

import numpy as np
import pytest
from rgl_files import make_tensors, write_tensors

from relume.assets.measured.measured_store import STORE, records, source_path, store_material
from relume.assets.measured.merl import CHANNEL_SCALE, grid_directions, is_measured, read_merl
from relume.assets.measured.read_measured import read_measured
from relume.assets.measured.spectra import rec709_weights
from relume.brdf.evaluate import eval_brdf
from relume.core.errors import MaterialError

TERMS = (
    {"model": "lambert", "color": [0.5, 0.2, 0.05]},
    {"model": "blinn_phong", "color": [0.1, 0.2, 0.3], "params": {"exponent": 12.0}},
)
BRUSHED = {"model": "ward_anisotropic", "color": [0.5, 0.5, 0.5], "params": {"alpha_x": 0.3, "alpha_y": 0.8}}


def brdf(wi, wo):
    return sum(eval_brdf(term, wi, wo) for term in TERMS)


def relative_rms(planes, expected, max_theta):
    wi, wo = grid_directions()
    inside = np.minimum(wi[..., 2], wo[..., 2]) > math.cos(math.radians(max_theta))
    assert is_measured(planes)[inside].all()
    values = np.moveaxis(planes, 0, -1)[inside] * CHANNEL_SCALE
    reference = expected(wi[inside], wo[inside])
    return float(np.sqrt(np.mean(((values - reference) / reference) ** 2)))


@pytest.fixture(scope="module")
def tensors():
    return make_tensors(brdf)


@pytest.mark.parametrize("has_jacobian", [True, False])
def test_rgl_file_is_its_brdf_on_the_grid(tmp_path, tensors, has_jacobian):
    write_tensors(tmp_path / "x.bsdf", tensors if has_jacobian else make_tensors(brdf, has_jacobian=False))
    measurement, is_merl = read_measured(tmp_path / "x.bsdf")
    assert not is_merl
    assert relative_rms(measurement.planes, brdf, 70) < 0.02
    assert measurement.warnings == ("nothing was measured beyond 85°; the nearest values stand in there",)
    wi, wo = grid_directions()
    assert not is_measured(measurement.planes)[np.minimum(wi[..., 2], wo[..., 2]) < math.cos(math.radians(86))].any()


def test_rgl_spectra_become_rec709(tmp_path, tensors):
    """A spectrum times f is its color times f; a flat one is gray."""
    gray = {name: array for name, array in tensors.items() if name != "rgb"}
    wavelengths = np.linspace(380, 780, 21, dtype=np.float32)
    spectrum = 0.2 + 0.6 * (wavelengths > 580)
    gray["spectra"] = np.ascontiguousarray(tensors["rgb"][:, :, :1] * spectrum[:, None, None], np.float32)
    write_tensors(tmp_path / "x.bsdf", gray | {"wavelengths": wavelengths})
    color = spectrum @ rec709_weights(np.float64(wavelengths))
    assert color[0] > 2 * color[2] > 0
    planes = read_measured(tmp_path / "x.bsdf")[0].planes
    assert relative_rms(planes, lambda wi, wo: brdf(wi, wo)[..., :1] * color, 70) < 0.02


@pytest.mark.slow
def test_anisotropic_rgl_file_becomes_its_mean_over_azimuths(tmp_path):
    quarter = np.linspace(-np.pi, -np.pi / 2, 7)
    file = make_tensors(lambda wi, wo: eval_brdf(BRUSHED, wi, wo), quarter, num_theta=14, size=32)
    write_tensors(tmp_path / "x.bsdf", file)
    measurement, _ = read_measured(tmp_path / "x.bsdf")
    assert "anisotropic" in measurement.warnings[0]

    def mean(wi, wo):
        total = np.zeros((len(wi), 3))
        for turn in np.arange(36) * np.pi / 18:
            c, s = math.cos(turn), math.sin(turn)
            rotation = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
            total += eval_brdf(BRUSHED, wi @ rotation, wo @ rotation)
        return total / 36

    planes = measurement.planes[:, ::10, ::10, ::12]
    wi, wo = (axis[::10, ::10, ::12] for axis in grid_directions())
    inside = np.minimum(wi[..., 2], wo[..., 2]) > math.cos(math.radians(60))
    values = np.moveaxis(planes, 0, -1)[inside] * CHANNEL_SCALE
    reference = mean(wi[inside], wo[inside])
    assert np.sqrt(np.mean((values - reference) ** 2) / np.mean(reference**2)) < 0.03


def test_spectral_weights_are_those_of_the_standard_observer():
    """White is white, and monochromatic bands have the signs of Rec. 709's gamut."""
    wavelengths = np.arange(400.0, 701.0, 10.0)
    np.testing.assert_allclose(np.full(31, 0.7) @ rec709_weights(wavelengths), [0.7, 0.7, 0.7])
    red, green, blue = (np.exp(-(((wavelengths - peak) / 15) ** 2)) @ rec709_weights(wavelengths)
                        for peak in (620, 530, 460))  # fmt: skip
    assert red[0] > 0 > red[2] - 0.01
    assert green[1] > 0 > green[0]
    assert blue[2] > 0 > blue[1] - 0.01
    np.testing.assert_allclose(rec709_weights(np.array([550.0])), [[1, 1, 1]])


def cornell_text(values=None, wavelengths="400 500 600 700", num=4):
    """Rows at 8 light and 10 view angles and azimuths 20° apart, with flat spectra of f."""
    rows = []
    for theta_i in np.radians(np.arange(10, 81, 10)):
        for theta_s in np.radians([0.0, 8, 16, 24, 33, 41, 50, 59, 69, 79]):
            for phi in np.radians(np.arange(0, 181, 20)):
                wi, wo = (np.array([math.sin(t) * math.cos(p), math.sin(t) * math.sin(p), math.cos(t)])
                          for t, p in ((theta_i, 0.0), (theta_s, phi)))  # fmt: skip
                value = float(brdf(wi, wo)[0]) if values is None else values
                rows.append(f"{theta_i:.6f} 0 {theta_s:.6f} {phi:.6f} " + " ".join([f"{value:.6f}"] * num))
    return f"# made by a test\n{num}\n# wls\n{wavelengths}\n" + "\n".join(rows) + "\n"


def test_scattered_values_are_interpolated_on_the_grid(tmp_path):
    (tmp_path / "x.brdf").write_text(cornell_text())
    measurement, is_merl = read_measured(tmp_path / "x.brdf")
    assert not is_merl
    assert "directions" in measurement.warnings[0]
    assert relative_rms(measurement.planes, lambda wi, wo: brdf(wi, wo)[..., :1], 70) < 0.06


def damaged_tensors(tensors, name, change):
    array = tensors[name].copy()
    return tensors | {name: change(array)}


def set_value(value):
    def change(array):
        array.flat[len(array.flat) // 2] = value
        return array

    return change


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("rgb", set_value(np.nan), "non-finite values in 'rgb'"),
        ("vndf", set_value(np.inf), "non-finite values in 'vndf'"),
        ("ndf", set_value(-1), "density below zero"),
        ("theta_i", lambda array: array[::-1].copy(), "ascend"),
        ("theta_i", lambda array: array * 3, "within a quarter"),
        ("theta_i", lambda array: array[:-1].copy(), "different directions"),
        ("sigma", lambda array: array[0].copy(), "no array 'sigma' of 2 axes"),
        ("rgb", lambda array: array[:, :, :2].copy(), "different directions"),
        ("rgb", lambda array: array * np.float32(1e12), "above 1e"),
        ("phi_i", lambda array: array[:0].copy(), "no array 'phi_i'"),
    ],
)
def test_rgl_files_with_bad_arrays_are_rejected(tmp_path, tensors, name, change, message):
    write_tensors(tmp_path / "x.bsdf", damaged_tensors(tensors, name, change))
    with pytest.raises(MaterialError, match=message):
        read_measured(tmp_path / "x.bsdf")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda content: content[:13], "damaged"),
        (lambda content: content[:40], "damaged"),
        (lambda content: content[:-100], "ends after the file"),
        (lambda content: content[:12] + b"\2\0" + content[14:], "version"),
        (lambda content: content[:14] + struct.pack("<I", 2**32 - 1) + content[18:], "arrays"),
        (lambda content: content[:18] + b"\xff\xff" + content[20:], "damaged"),
        (lambda content: content[:25] + struct.pack("<HBQQ", 1, 10, 2**63, 2**63) + content[44:], "ends after"),
        (lambda content: content[:25] + struct.pack("<HBQQ", 1, 10, 300, 2**62) + content[44:], "ends after"),
        (lambda content: content[:25] + struct.pack("<HBQQ", 1, 99, 300, 1) + content[44:], "type 99"),
        (lambda content: content[:25] + struct.pack("<HBQQ", 60000, 10, 300, 1) + content[44:], "60000 axes"),
        (lambda content: b"tensor-file\0" + content[12:], "not a MERL file"),
    ],
)
def test_rgl_files_with_bad_headers_are_rejected(tmp_path, tensors, change, message):
    path = tmp_path / "x.bsdf"
    write_tensors(path, tensors)
    content = path.read_bytes()
    assert content[20:25] == b"phi_i"
    path.write_bytes(change(content))
    with pytest.raises(MaterialError, match=message):
        read_measured(path)


def test_polarized_and_huge_tensor_files_are_rejected(tmp_path, tensors):
    write_tensors(tmp_path / "x.pbsdf", {"M": tensors["rgb"]})
    with pytest.raises(MaterialError, match="polarized"):
        read_measured(tmp_path / "x.pbsdf")
    with (tmp_path / "huge.bsdf").open("wb") as file:
        file.write(b"tensor_file\0\1\0")
        file.truncate(1 << 40)
    with pytest.raises(MaterialError, match="1,099,511,627,776 bytes"):
        read_measured(tmp_path / "huge.bsdf")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("# only a comment\n", "wavelengths"),
        ("1e9 400\n", "wavelengths"),
        ("4.5 400\n", "wavelengths"),
        ("# x\nnan 400\n", "wavelengths"),
        ("4\n400 500 600 700\n0.1 0 0.2 0 1 1 1 1\n", "whole rows"),
        (cornell_text(0.1)[:-12], "numbers more"),
        (cornell_text(0.1).replace("0.100000", "nan", 1), "non-finite"),
        (cornell_text(0.1).replace("0.100000", "1e30", 1), "above 1e"),
        (cornell_text(0.1).replace("0.100000", "red", 1), "words"),
        (cornell_text(0.1, "400 500 500 700"), "ascend"),
        (cornell_text(0.1).replace("0.174533", "1.8", 1), "below the horizon"),
        ("4\n400 500 600 700\n" + "0.1 0 0.2 0 1 1 1 1\n" * 5000, "whole rows"),
        ("9" * 5_000_000, "5,000,000 bytes"),
    ],
    ids=lambda value: value[:12],
)
def test_bad_scattered_files_are_rejected(tmp_path, text, message):
    (tmp_path / "x.brdf").write_text(text)
    with pytest.raises(MaterialError, match=message):
        read_measured(tmp_path / "x.brdf")


def test_store_keeps_the_conversion_and_its_warnings(tmp_path, tensors):
    write_tensors(tmp_path / "paint.bsdf", tensors)
    with STORE.with_search_folder(tmp_path / "materials") as folder:
        record = store_material(folder, tmp_path / "paint.bsdf", "Paint")
        assert records(folder) == [record]
        assert len(record.warnings) == 1
        np.testing.assert_allclose(
            read_merl(source_path(record.data)), read_measured(tmp_path / "paint.bsdf")[0].planes
        )
        wi, wo = np.array([0.3, 0.1, 0.9]), np.array([-0.5, 0.4, 0.7])
        wi, wo = wi / np.linalg.norm(wi), wo / np.linalg.norm(wo)
        total = sum(eval_brdf({**term, "color": [1, 1, 1]}, wi, wo) for term in record.terms())
        np.testing.assert_allclose(total, brdf(wi, wo), rtol=0.03)
