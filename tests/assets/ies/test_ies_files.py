"""IES files: values of all versions and symmetries, and errors for broken ones."""

import codecs

import numpy as np
import pytest
from ies_files import cosine_web, ies_text

from relume.assets.ies.ies_store import IES_FILES, load_web, store_ies
from relume.assets.ies.read_ies import MAX_FILE_BYTES, read_ies
from relume.core.errors import SceneError

POLAR = np.arange(0, 91, 2.5)


def read(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "lamp.ies"
    path.write_bytes(text if isinstance(text, bytes) else text.encode(encoding))
    return read_ies(path, "Lamp")


def at(web, polar, azimuth=0):
    values = web.relative_intensity
    return values[round(4 * polar), azimuth if values.shape[1] > 1 else 0]


@pytest.mark.parametrize(
    "head", ["IESNA:LM-63-2002", "IES:LM-63-2019", "IESNA:LM-63-1995", "IESNA91", "A spot of 1986"]
)
def test_intensity_is_relative_to_the_maximum_and_factors_multiply_it(tmp_path, head):
    text = ies_text(cosine_web(2, POLAR), POLAR, head=head, factors=(3, 0.9, 0.5))
    web, warnings = read(tmp_path, text)
    assert web.candela == pytest.approx(3 * 0.9 * (1 if "200" in head or "201" in head else 0.5) * 1000)
    assert web.relative_intensity.shape == (721, 1)
    assert not warnings
    assert at(web, 0) == 1
    assert at(web, 60) == pytest.approx(0.25, rel=1e-5)
    assert at(web, 91) == at(web, 180) == 0
    assert at(web, 1.25) == pytest.approx((1 + np.cos(np.radians(2.5)) ** 2) / 2, rel=1e-5)


@pytest.mark.parametrize("last", [180, 345, 360])
def test_webs_of_a_half_and_of_all_planes_agree(tmp_path, last):
    azimuth = np.arange(0, last + 1, 15)
    web, _ = read(tmp_path, ies_text(cosine_web(1, POLAR, azimuth), POLAR, azimuth))
    assert web.candela == pytest.approx(1500)
    for c in range(0, 361, 15):
        assert at(web, 60, c) == pytest.approx(0.5 * (1 + np.cos(np.radians(c)) / 2) / 1.5, rel=1e-4)


def test_a_quadrant_is_mirrored_about_both_planes(tmp_path):
    candela = np.outer([1, 2, 4], np.ones(len(POLAR)))
    web, _ = read(tmp_path, ies_text(candela, POLAR, (0, 45, 90)))
    for c, expected in {0: 1, 45: 2, 90: 4, 135: 2, 180: 1, 225: 2, 270: 4, 315: 2, 360: 1}.items():
        assert at(web, 30, c) == pytest.approx(expected / 4)


def test_a_half_from_c90_to_c270_is_mirrored_about_c90(tmp_path):
    candela = np.outer([1, 2, 4], np.ones(len(POLAR)))
    web, _ = read(tmp_path, ies_text(candela, POLAR, (90, 180, 270)))
    for c, expected in {90: 1, 180: 2, 270: 4, 0: 2, 45: 1.5, 315: 3, 360: 2}.items():
        assert at(web, 30, c) == pytest.approx(expected / 4)


@pytest.mark.parametrize(
    ("encoding", "prefix"),
    [("utf-8-sig", b""), ("utf-16", b""), ("utf-16-le", b""), ("utf-16-be", codecs.BOM_UTF16_BE), ("utf-16-be", b"")],
)
def test_encodings_have_the_same_values(tmp_path, encoding, prefix):
    text = ies_text(cosine_web(1, POLAR), POLAR)
    web, _ = read(tmp_path, prefix + text.encode(encoding))
    assert at(web, 60) == pytest.approx(0.5, rel=1e-5)


@pytest.mark.parametrize("comma", ["decimal", "separator", "separator of integers"])
def test_commas_are_decimal_marks_or_separators(tmp_path, comma):
    candela = [[1000, 500, 0]] if "integers" in comma else [[1000.5, 500.25, 0]]
    head, numbers = ies_text(candela, (0, 45, 90)).split("TILT=NONE")
    numbers = numbers.replace(".", ",") if comma == "decimal" else numbers.replace(" ", ",")
    web, _ = read(tmp_path, head + "TILT=NONE" + numbers)
    assert web.candela == candela[0][0]
    assert at(web, 45) == pytest.approx(0.5, abs=1e-6)


def test_tilt_is_ignored_with_a_warning(tmp_path):
    text = ies_text([[100, 50]], (0, 90)).replace("TILT=NONE", "TILT=INCLUDE\n1\n3\n0 45 90\n1 .9 .8")
    for version in (text, ies_text([[100, 50]], (0, 90), tilt="lamp.tlt")):
        web, (warning,) = read(tmp_path, version)
        assert web.candela == 100
        assert at(web, 45) == pytest.approx(0.75)
        assert warning.severity == "approximated"
        assert "tilt" in warning


GOOD = ies_text([[100, 50]], (0, 90))
BROKEN = {
    "no tilt": (GOOD.replace("TILT=NONE", ""), "no line TILT="),
    "empty": ("", "no line TILT="),
    "no candela": (GOOD.replace("100 50", ""), "ends after 16 of 18 numbers"),
    "word": (GOOD.replace("100 50", "100 x"), "has a word"),
    "zero angles": (GOOD.replace("1 1000 1 2 1", "1 1000 1 0 1"), "0 vertical angles"),
    "one angle": (ies_text([[100]], (0,)), "one vertical angle"),
    "half an angle": (GOOD.replace("1 1000 1 2 1", "1 1000 1 2.5 1"), "2.5 vertical angles"),
    "many angles": (GOOD.replace("1 1000 1 2 1", "1 1000 1 2 100000"), "100000 horizontal angles"),
    "huge number of angles": (GOOD.replace("1 1000 1 2 1", "1 1000 1 1e300 1"), "1e\\+300 vertical angles"),
    "NaN angles": (GOOD.replace("1 1000 1 2 1", "1 1000 1 nan 1"), "nan vertical angles"),
    "no header": (GOOD.split("1 1000")[0], "nan vertical angles"),
    "tilt angles": (GOOD.replace("TILT=NONE", "TILT=INCLUDE 1 1e9"), "1e\\+09 tilt angles"),
    "NaN": (GOOD.replace("100 50", "100 nan"), "infinite or NaN"),
    "infinite": (GOOD.replace("100 50", "100 1e999"), "infinite or NaN"),
    "negative": (GOOD.replace("100 50", "100 -5"), "from -5 to 100 cd"),
    "dark": (GOOD.replace("100 50", "0 0"), "must be positive"),
    "negative factor": (ies_text([[100, 50]], (0, 90), factors=(-1, 1, 1)), "must be positive"),
    "type B": (ies_text([[100, 50]], (0, 90), kind=2), "type B; export it as type C"),
    "type A": (ies_text([[100, 50]], (0, 90), kind=3), "type A; export it as type C"),
    "type 9": (ies_text([[100, 50]], (0, 90), kind=9), "type 9; export it as type C"),
    "falling": (ies_text([[100, 50]], (90, 0)), "vertical angles must increase"),
    "below": (ies_text([[100, 50]], (-10, 90)), "vertical angles must increase"),
    "beyond": (ies_text([[100, 50]], (0, 190)), "vertical angles must increase"),
    "gap": (ies_text([[100, 50]] * 2, (0, 90), (0, 120)), "0° to 120°"),
    "start": (ies_text([[100, 50]] * 2, (0, 90), (10, 360)), "10° to 360°"),
    "binary": (bytes(range(256)) * 10, "no line TILT="),
    "large": (b"TILT=NONE " + b"1 " * MAX_FILE_BYTES, "larger than 2 MB"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_broken_files_have_a_clear_error(tmp_path, name):
    text, message = BROKEN[name]
    with pytest.raises(SceneError, match=message):
        read(tmp_path, text)


def test_stored_files_have_the_emission_of_their_candela(tmp_path):
    path = tmp_path / "lamp.ies"
    path.write_text(ies_text(cosine_web(1, POLAR, scale=6830), POLAR))
    with IES_FILES.with_search_folder(tmp_path / "ies") as library:
        record = store_ies(library, path, "Lamp")
        assert record.candela == pytest.approx(6830)
        assert record.emission == pytest.approx(10)
        assert load_web(record.reference)[240, 0] == pytest.approx(0.5, rel=1e-5)
