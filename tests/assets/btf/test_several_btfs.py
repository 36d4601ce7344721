"""Several BTFs at once: their tables are computed once, in the background, in the one cache."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from session_edits import kind_of
from test_fixed_camera_btfs import CAMERA, GRAY, SIZE
from tiny_scenes import make_tiny_scene, quad, studio

from relume.assets.btf.btf_store import load_btf, store_btf
from relume.brdf.terms import btf as term
from relume.core import cache as memories
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.progressive_picture import ProgressivePicture
from relume.live.free_camera.texel_brdf import texel_tables
from relume.live.opened.openers import open_bake
from relume.look import validate
from relume.methods.registry import METHODS
from relume.scene.model import Material
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

NUM = 5
NAMES = [f"Strip {k}" for k in range(NUM)]


@pytest.fixture(scope="module")
def records(small_btf, tmp_path_factory):
    whole, folder = load_btf(small_btf.record.data), tmp_path_factory.mktemp("sources")
    stored = []
    for number in range(NUM):
        source = folder / f"{number}.txt"
        source.write_text(str(number))
        factor = np.float32(1 - 0.1 * number)
        dimmed = replace(whole, mean=(whole.mean * factor).astype(np.float16), mean_step=whole.mean_step * factor,
                         average=whole.average * factor)  # fmt: skip
        stored.append(store_btf(small_btf.folder, source, f"Cords {number}", None, lambda made=dimmed: made))
    return stored


@pytest.fixture(scope="module")
def strips():
    """Five strips of a floor, and a sixth strip."""
    edges = np.linspace(-1, 1, NUM + 2)
    floor = [
        quad(f"strip {k}", [[a, 0, 1], [b, 0, 1], [b, 0, -1], [a, 0, -1]], k)
        for k, (a, b) in enumerate(pairwise(edges))
    ]
    materials = [Material(name, (GRAY,)) for name in (*NAMES, "Other")]
    return make_tiny_scene(*floor, camera=CAMERA, environment=studio(32, 20.0), materials=materials)


@pytest.fixture(params=["direct", "probes"])
def opened(request, strips, tmp_path, monkeypatch):
    """A bake with an empty cache."""
    memory = Cache(1 << 30)
    monkeypatch.setattr(memories._AssetCache, "cache", memory)
    recipe = Recipe(request.param, ("front",), SIZE, 100, num_probes=800)
    return open_bake(bake_in_process(METHODS[request.param], strips, recipe, tmp_path / "s.zarr"), memory)


def look_of(bake, records, gray=0.5):
    """BTFs on all strips, and a gray material on the sixth."""
    covered = {name: {"terms": record.terms()} for name, record in zip(NAMES, records, strict=True)}
    other = {"terms": [{"model": "lambert", "color": [gray] * 3}]}
    return validate({"materials": {**covered, "Other": other}}, bake.default_look)


def run_to_the_end(picture):
    for _ in range(100):
        picture.advance(None)
        if (job := picture.next_job()) is None:
            return picture
        job.apply(job.run(lambda fraction: None, lambda: False))
    raise AssertionError("it never rests")


def count(monkeypatch, module, name):
    made, whole = Counter(), getattr(module, name)

    def counted(self):
        made[round(float(self.mean.sum(dtype=np.float64)), 2)] += 1
        return whole(self)

    monkeypatch.setattr(module, name, counted)
    return made


def test_edits_of_another_material_do_not_rebuild_tables(opened, records, monkeypatch):
    is_moving = opened.camera_mode.name == "FREE"
    made = (
        count(monkeypatch, texel_tables, "compute_texel_tables")
        if is_moving
        else count(monkeypatch, term.LocalPcaBtf, "tables")
    )
    picture = (FreeCameraPicture if is_moving else lambda *args, **how: Picture(args[0], args[1], opened.cache, **how))(
        opened, "front", is_watched=True
    )
    for number in range(4):
        picture.set_look(look_of(opened, records, 0.2 + 0.1 * number))
        run_to_the_end(picture)
    assert len(made) == NUM
    assert set(made.values()) == {1}
    assert (
        sum(bytes_ for holder, bytes_ in opened.cache.bytes_by_owner().items() if holder.kind.startswith("BTF tables"))
        > 0
    )


@pytest.mark.parametrize("opened", ["probes"], indirect=True)
def test_frames_show_the_mean_until_the_tables_are_ready(opened, records, monkeypatch):
    picture = FreeCameraPicture(opened, "front", is_watched=True)
    picture.set_look(look_of(opened, records))
    with monkeypatch.context() as during:
        during.setattr(texel_tables, "compute_texel_tables", lambda whole: pytest.fail("made by a frame"))
        picture.advance(None)
        mean = picture.image()
        while kind_of(job := picture.next_job()) != "BTF tables":
            job.apply(job.run(lambda fraction: None, lambda: False))
            picture.advance(None)
            mean = picture.image()
    image = run_to_the_end(picture).image()
    alone = FreeCameraPicture(opened, "front")
    alone.set_look(look_of(opened, records))
    alone.advance(None)
    expected = alone.image()
    size = np.linalg.norm(expected)
    assert np.linalg.norm(image - expected) < 0.02 * size < 0.05 * size < np.linalg.norm(mean - expected)


@pytest.mark.parametrize("opened", ["probes"], indirect=True)
def test_a_moving_camera_computes_tables_once(opened, records):
    picture = ProgressivePicture(FreeCameraPicture(opened, "front", is_watched=True), refuse_static_view, opened.cache)
    picture.set_look(look_of(opened, records))
    picture.set_camera(opened.views["front"].camera, (32, 24), is_idle=False)
    run_to_the_end(picture)


def refuse_static_view(*args, **kwargs):
    pytest.fail("the camera moves")


@pytest.mark.parametrize("opened", ["probes"], indirect=True)
def test_an_edit_of_another_material_does_not_change_btfs(opened, records):
    picture = FreeCameraPicture(opened, "front", is_watched=True)
    picture.set_look(look_of(opened, records, 0.2))
    run_to_the_end(picture)
    picture.set_look(look_of(opened, records, 0.7))
    picture.advance(None)
    anew = FreeCameraPicture(opened, "front", is_watched=True)
    anew.set_look(look_of(opened, records, 0.7))
    run_to_the_end(anew)
    np.testing.assert_allclose(picture.image(), anew.image(), rtol=1e-3, atol=1e-4)
