"""Imported and built-in environments: storage, names, damaged files."""

import io
import json
import shutil

import numpy as np
import pytest
from environment_files import dusk, write_map
from PIL import Image

from relume.assets.environments import environment_store
from relume.assets.environments.built_in import BUILT_IN, load_built_in
from relume.assets.environments.environment_names import environment_exists, environment_names, load_environment
from relume.assets.environments.environment_store import STORE, store_environment, thumbnail_path
from relume.assets.environments.equirect import texel_directions, texel_solid_angles
from relume.assets.environments.thumbnail import thumbnail
from relume.core.color import luminance
from relume.core.errors import NotFoundError, SceneError
from relume_server.io.import_request import remove_strays


def test_an_import_is_listed_and_found_by_its_name(library):
    (record,) = STORE.list_records(library)
    assert (record.name, record.reference, record.warnings) == ("Dusk", f"env:{record.id}", ())
    environment = load_environment(record.reference)
    assert environment.name == "Dusk"
    np.testing.assert_array_equal(environment.radiance, dusk())
    assert not environment.radiance.flags.writeable
    assert environment_exists(record.reference)
    assert environment_names() == [*BUILT_IN, record.reference]
    with Image.open(thumbnail_path(library, record.id)) as picture:
        assert (picture.size, picture.mode) == ((192, 96), "RGB")


def test_importing_the_same_file_again_takes_the_new_name(dusk_file, tmp_path):
    first = store_environment(tmp_path / "library", dusk_file, "One")
    again = store_environment(tmp_path / "library", dusk_file, "Two")
    assert (again.id, again.name, again.created) == (first.id, "Two", first.created)
    assert len(STORE.list_records(tmp_path / "library")) == 1


def test_a_bad_file_leaves_nothing_behind(tmp_path):
    (tmp_path / "bad.hdr").write_bytes(b"#?RADIANCE\n\n-Y 4 +X 8\n")
    with pytest.raises(SceneError, match="bad"):
        store_environment(tmp_path / "library", tmp_path / "bad.hdr", "bad")
    assert not (tmp_path / "library").exists()


def test_leftovers_of_a_killed_import_are_overwritten(tmp_path):
    def killed(made):
        (stray,) = (tmp_path / "library").iterdir()
        shutil.copytree(stray, tmp_path / "left" / stray.name)
        raise SceneError("killed")

    (tmp_path / "some.hdr").write_bytes(b"some")
    with pytest.raises(SceneError, match="killed"):
        STORE.store(tmp_path / "library", tmp_path / "some.hdr", "Some", killed)
    remove_strays(tmp_path, older_than_s=-1)
    assert not list((tmp_path / "left").iterdir())


def test_large_maps_are_downsampled_and_keep_their_brightness(tmp_path, monkeypatch):
    monkeypatch.setattr(environment_store, "MAX_WIDTH", 32)
    pixels = np.random.default_rng(1).uniform(0, 4, (48, 96, 3)).astype(np.float32)
    path = write_map(tmp_path / "large.exr", pixels)
    with STORE.with_search_folder(tmp_path / "library") as folder:
        record = store_environment(folder, path, "Large")
        assert record.warnings == ("Environment “Large” was scaled from 96×48 to 32×16.",)
        radiance = load_environment(record.reference).radiance
    np.testing.assert_allclose(radiance, pixels.reshape(16, 3, 32, 3, 3).mean(axis=(1, 3)), rtol=1e-5)


@pytest.mark.parametrize("name", ["", "env:", "env:../../etc", "env:0123456789abcdef", "Studio", "0123456789abcdef"])
def test_other_names_are_unknown(library, name):
    assert not environment_exists(name)
    with pytest.raises(NotFoundError, match="import its file again"):
        load_environment(name)


@pytest.mark.parametrize(
    ("file", "content"),
    [
        ("environment.json", b"{"),
        ("environment.json", json.dumps({"format": 1, "name": 3, "created": 1.0}).encode()),
        ("radiance.npy", b""),
        ("radiance.npy", b"\x93NUMPY\x01\x00"),
    ],
)
def test_errors_name_damaged_environment_files(library, tmp_path, file, content):
    shutil.copytree(library / STORE.list_records(library)[0].id, tmp_path / "fedcba9876543210")
    (tmp_path / "fedcba9876543210" / file).write_bytes(content)
    with STORE.with_search_folder(tmp_path), pytest.raises(SceneError, match="import it again"):
        load_environment("env:fedcba9876543210")


def test_arrays_of_other_shapes_are_damage(library, tmp_path):
    shutil.copytree(library / STORE.list_records(library)[0].id, tmp_path / "fedcba9876543210")
    for shape in ((4, 4, 3), (4, 8), (4, 8, 4), (0, 0, 3)):
        np.save(tmp_path / "fedcba9876543210" / "radiance.npy", np.ones(shape, np.float32))
        with STORE.with_search_folder(tmp_path), pytest.raises(SceneError, match="damaged"):
            load_environment("env:fedcba9876543210")


def test_a_record_without_warnings_is_damage(library, tmp_path):
    shutil.copytree(library / STORE.list_records(library)[0].id, tmp_path / "fedcba9876543210")
    (tmp_path / "fedcba9876543210" / "environment.json").write_text('{"format": 1, "name": "x", "created": 1.0}')
    with pytest.raises(SceneError, match="damaged"):
        STORE.get_record(tmp_path, "fedcba9876543210")


def mean_luminance(radiance):
    height, width, _ = radiance.shape
    return (luminance(radiance) * texel_solid_angles(height, width)[:, None]).sum() / (4 * np.pi)


@pytest.mark.parametrize("name", BUILT_IN)
def test_built_in_environments_are_valid_and_as_bright_as_the_studio(name):
    radiance = load_built_in(name).radiance
    assert radiance.dtype == np.float32
    assert radiance.shape == (256, 512, 3)
    assert np.isfinite(radiance).all()
    assert radiance.min() > 0
    assert mean_luminance(radiance) == pytest.approx(mean_luminance(load_built_in("studio").radiance), rel=0.01)
    assert load_built_in(name) is load_built_in(name)


def test_overcast_zenith_is_three_times_the_horizon():
    light = luminance(load_built_in("overcast").radiance)
    assert light[0].mean() / light[127].mean() == pytest.approx(3.0, rel=0.02)


@pytest.mark.parametrize(("name", "elevation"), [("clear_sky", 48.0), ("sunset", 5.0)])
def test_the_sun_is_at_its_stated_elevation(name, elevation):
    light = luminance(load_built_in(name).radiance)
    y = texel_directions(256, 512)[..., 1]
    assert np.degrees(np.arcsin(y.ravel()[light.argmax()])) == pytest.approx(elevation, abs=0.7)


def test_thumbnails_are_exposed_automatically():
    radiance = np.random.default_rng(2).uniform(0.5, 1.0, (32, 64, 3)).astype(np.float32)
    pictures = [np.asarray(Image.open(io.BytesIO(thumbnail(radiance * scale))), int) for scale in (1e-3, 1.0, 1e3)]
    for picture in pictures:
        assert np.abs(picture - pictures[1]).max() <= 1


def test_a_thumbnail_of_a_map_with_black_in_it():
    black = np.zeros((16, 32, 3), np.float32)
    black[3, 4] = 5.0
    assert thumbnail(black).startswith(b"\x89PNG")
