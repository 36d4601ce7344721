"""Free-camera pictures during light edits: direct light and delayed indirect light."""

import numpy as np
import pytest
from free_camera_pictures import finish_lighting, finish_refinement, make_picture, make_watched_picture, run_job
from look_edits import (
    EDITS,
    LOBE,
    add_lights,
    draw_curve,
    edit_environment,
    edit_transport,
    replace_terms,
    set_exponent,
    set_floor_color,
)
from session_edits import make_look, relative_rmse

from relume.core.cache import Cache
from relume.core.errors import CancelledError, ChunkDamagedError
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.opened.harmonic_light import read_harmonic_light
from relume.live.opened.openers import open_bake
from relume.live.opened.stored_patches import read_patches
from relume.store.reader import open_store

ROUNDED = 1e-4  # float32 sums of one thousand lights in another order


@pytest.mark.parametrize("edit", ["a light moved", "the environment turned", "fewer paths", "all at once"])
def test_moving_light_is_approximate_and_converges_to_the_unwatched_picture(free_bake, edit):
    _, change = EDITS[edit]
    other = edit_environment(rotation=11.0 * (1 + list(EDITS).index(edit)))  # its light is not cached
    picture = FreeCameraPicture(free_bake, "front", is_watched=True)
    picture.set_look(make_look(free_bake, add_lights(change, other)))
    assert picture.advance(None).fidelity == "preview"
    rough = picture.image()
    assert not picture.advance(None).changed
    job = picture.next_job()
    assert job.is_refinement
    with pytest.raises(CancelledError):
        job.run(lambda share: None, lambda: True)
    shares = []
    job.apply(job.run(shares.append, lambda: False))
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert picture.next_job() is None
    assert picture.advance(None).fidelity == "approximate"
    finish_refinement(picture)
    exact = make_picture(free_bake, change, other).image()
    np.testing.assert_array_equal(picture.image(), exact)
    assert relative_rmse(rough, exact) < 0.3


def test_bakes_without_harmonics_follow_light(baked, free_bake, monkeypatch):
    turned = edit_environment(rotation=203.0)

    def rough(transfer):
        picture = FreeCameraPicture(transfer, "front", is_watched=True)
        picture.set_look(make_look(transfer, add_lights(turned)))
        assert picture.advance(None).fidelity == "preview"
        return picture.image()

    harmonic = rough(free_bake)
    monkeypatch.setattr("relume.live.opened.fixed_views_indirect.read_harmonic_light", lambda store, cells: None)
    plain = rough(open_bake(baked, Cache(1 << 30)))
    assert 0 < relative_rmse(harmonic, plain) < 0.04


def test_harmonics_of_a_wrong_shape_are_rejected(baked, free_bake):
    store = open_store(baked)

    class Damaged:
        attributes, shape = store.attributes, store.shape

        def read(self, path, start=0, stop=None):
            rows = store.read(path, start, stop)
            return rows[:-1] if path == "sh/weight" else rows

    with pytest.raises(ChunkDamagedError, match="sh is damaged"):
        read_harmonic_light(Damaged(), read_patches(store))


FOLLOWED = {
    "a highlight's exponent": (LOBE, set_exponent(60)),
    "a curve drawn": (LOBE, draw_curve),
    "a diffuse color": ("/materials/Floor/terms/0/color", set_floor_color),
    "a metal in place of a wall": (None, replace_terms),
    "fewer paths": (None, edit_transport(bounces=1)),
    "all of them": (
        LOBE,
        lambda document: [change(document) for change in (draw_curve, set_floor_color, edit_transport(bounces=2))],
    ),
}


@pytest.mark.parametrize("edit", FOLLOWED)
@pytest.mark.parametrize("solo", [None, frozenset({"Bulb"})])
def test_indirect_light_follows_edits(free_bake, edit, solo):
    """With cached light, a frame is the exact image plus the change of indirect light, computed in the background;
    the final picture is exact.
    """
    pointer, change = FOLLOWED[edit]
    other = edit_environment(
        rotation=100.0 + 2 * list(FOLLOWED).index(edit) + (solo is None)
    )  # not cached by other tests

    def shown(*changes):
        return make_look(free_bake, add_lights(other, *changes))

    picture = FreeCameraPicture(free_bake, "front", is_watched=True)
    picture.set_look(shown(), solo=solo)
    picture.advance(None)
    finish_refinement(picture)
    before = picture.image()
    if pointer is not None:
        picture.prepare(pointer)
    picture.set_look(shown(change), solo=solo)
    assert picture.advance(None).fidelity == "preview"
    stale = picture.image()  # new materials, previous indirect light
    job = picture.next_job()
    assert not job.is_refinement
    job.apply(run_job(job))
    assert picture.advance(None).fidelity == "preview"
    image = picture.image()
    finish_lighting(picture)
    assert np.linalg.norm(image - picture.image()) < 0.1 * np.linalg.norm(stale - picture.image())
    finish_refinement(picture)
    exact = picture.image()
    alone = FreeCameraPicture(free_bake, "front")
    alone.set_look(shown(change), solo=solo)
    alone.advance(None)
    np.testing.assert_array_equal(exact, alone.image())
    picture.set_look(shown(), solo=solo)
    assert picture.advance(None).fidelity == "approximate"  # cached
    finish_refinement(picture)
    np.testing.assert_array_equal(picture.image(), before)


def test_edits_and_indirect_light_do_not_wait_for_each_other(free_bake, monkeypatch):
    """Twice: an edit updates part of the frame, then the earlier background job updates all of it."""
    other = edit_environment(rotation=301.0)
    picture = make_watched_picture(free_bake, other)
    picture.set_look(make_look(free_bake, add_lights(other, set_exponent(30))))
    picture.advance(None)
    for step in (60, 90):
        job, before = picture.next_job(), picture.image()
        with monkeypatch.context() as nothing_whole:
            nothing_whole.setattr("relume.live.free_camera.free_camera_picture.render_frame", None)
            nothing_whole.setattr("relume.live.free_camera.probe_light.update_reflectances", None)
            picture.set_look(make_look(free_bake, add_lights(other, set_exponent(step))))
            assert picture.advance(None).changed
        edited = picture.image()
        assert (edited != before).any()
        job.apply(run_job(job))
        assert picture.advance(None).changed
        assert (picture.image() != edited).any()
        assert picture.next_job().key != job.key  # for the newer look
    finish_refinement(picture)
    np.testing.assert_array_equal(picture.image(), make_picture(free_bake, set_exponent(90), other).image())


@pytest.fixture
def many_probes(monkeypatch):
    """All bakes count as large: indirect light is computed in the background."""
    monkeypatch.setattr("relume.live.free_camera.probe_light.MAX_PROBES_IN_FRAME", 0)


def test_indirect_light_of_few_probes_follows_a_rotating_light_in_each_frame(free_bake, moved_camera):
    picture = make_watched_picture(free_bake, edit_environment(rotation=340.0))
    for turn, camera in ((348.0, None), (356.0, moved_camera)):
        now = make_look(free_bake, add_lights(edit_environment(rotation=turn)))
        at_once = FreeCameraPicture(free_bake, "front", is_watched=True)
        for each in (picture, at_once):
            if camera is not None:
                each.set_camera(camera, (64, 40))
            each.set_look(now)
            assert each.advance(None).fidelity == "preview"
        np.testing.assert_allclose(picture.image(), at_once.image(), rtol=ROUNDED, atol=ROUNDED)
        assert picture.next_job().is_refinement


@pytest.mark.parametrize("spare", [0, -1])
def test_visible_probes_and_patches_limit_indirect_light_in_frames(free_bake, monkeypatch, spare):
    """The limit counts what a frame computes, not all probes of the scene."""
    picture = make_watched_picture(free_bake, edit_environment(rotation=340.0))
    num_visible = np.count_nonzero(picture.gbuffer.is_needed)
    assert num_visible < free_bake.stored_scene.probes.num_points
    limit = num_visible + 3 * free_bake.num_patches + spare
    monkeypatch.setattr("relume.live.free_camera.probe_light.MAX_PROBES_IN_FRAME", limit)
    for turn in (348.0, 356.0):
        picture.set_look(make_look(free_bake, add_lights(edit_environment(rotation=turn))))
        picture.advance(None)
    assert picture.next_job().is_refinement == (spare == 0)


@pytest.mark.usefixtures("many_probes")
def test_indirect_light_lags_behind_a_rotating_light_and_converges(free_bake):
    turns = [make_look(free_bake, add_lights(edit_environment(rotation=turn))) for turn in (310.0, 318.0, 326.0)]
    picture = make_watched_picture(free_bake, edit_environment(rotation=310.0))
    picture.set_look(turns[1])
    picture.advance(None)
    job, behind = picture.next_job(), picture.image()
    assert not job.is_refinement
    picture.set_look(turns[2])
    picture.advance(None)
    job.apply(run_job(job))
    picture.advance(None)
    job = picture.next_job()
    job.apply(run_job(job))
    assert picture.advance(None).fidelity == "preview"
    assert picture.next_job().is_refinement
    final_image = picture.image()
    at_once = FreeCameraPicture(free_bake, "front", is_watched=True)
    at_once.set_look(turns[2])
    at_once.advance(None)
    np.testing.assert_allclose(final_image, at_once.image(), rtol=ROUNDED, atol=ROUNDED)
    assert relative_rmse(behind, final_image) > 1e-3
    finish_refinement(picture)
    np.testing.assert_array_equal(picture.image(), make_picture(free_bake, edit_environment(rotation=326.0)).image())


@pytest.mark.usefixtures("many_probes")
def test_moving_camera_has_indirect_light_everywhere(free_bake, moved_camera):
    """The light rotates and the camera moves before indirect light is ready: every probe still has indirect light."""
    picture = make_watched_picture(free_bake, edit_environment(rotation=331.0))
    now = make_look(free_bake, add_lights(edit_environment(rotation=339.0)))
    picture.set_look(now)
    picture.advance(None)
    job = picture.next_job()
    picture.set_camera(moved_camera, (64, 40))
    picture.advance(None)
    before = picture.image()
    job.apply(run_job(job))
    picture.advance(None)
    at_once = FreeCameraPicture(free_bake, "front", is_watched=True)
    at_once.set_look(now)
    at_once.set_camera(moved_camera, (64, 40))
    at_once.advance(None)
    np.testing.assert_allclose(picture.image(), at_once.image(), rtol=ROUNDED, atol=ROUNDED)
    assert 0 < relative_rmse(before, at_once.image()) < 0.1


def test_shader_blocks_contain_followed_light(free_bake):
    def bounces(*changes):
        return make_look(free_bake, add_lights(edit_environment(rotation=171.0), *changes))

    def blocks_of(picture):
        arrays = {}
        for name, block in picture.array_blocks()[0].items():
            if name.startswith("vectors/"):
                light = block.make()
                scale, num = light[f"{name}/scale"][0]
                numbers = light[name].astype(np.float32).reshape(-1, -(-3 * int(num) // 4) * 4)
                arrays[name, int(num)] = scale * numbers[:, : 3 * int(num)]
        return arrays

    picture = FreeCameraPicture(free_bake, "front", is_watched=True)
    picture.renders_pixels = False
    picture.set_look(bounces())
    picture.advance(None)
    finish_refinement(picture)
    picture.set_look(bounces(set_floor_color, set_exponent(8.0)))
    assert picture.advance(None).fidelity == "preview"
    job = picture.next_job()
    job.apply(run_job(job))
    assert picture.advance(None).fidelity == "preview"
    followed = blocks_of(picture)
    finish_refinement(picture)
    exact = blocks_of(picture)
    assert followed.keys() == exact.keys()
    assert {num for _, num in exact} == {1, 36}  # diffuse floor, glossy wall
    for (name, num), values in exact.items():
        irradiance = slice(None, None, num)  # the first function of each channel
        assert 0 < relative_rmse(followed[name, num][:, irradiance], values[:, irradiance]) < 0.01
