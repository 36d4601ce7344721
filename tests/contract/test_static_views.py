"""A free-camera picture converges to the fixed view baked there when the camera stops, and follows edits."""

import numpy as np
import pytest
from look_edits import EDITS, LOBE, add_lights, draw_curve, edit_light, edit_transport, set_floor_color
from session_edits import kind_of, make_look, relative_rmse, run_next_job

from relume.core.cache import Cache
from relume.core.errors import CancelledError, ResultUnavailableError
from relume.live.free_camera.frame import render_frame
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.progressive_picture import ProgressivePicture
from relume.live.opened.extended_store import ExtendedStore
from relume.live.opened.openers import open_bake, open_transfer
from relume.live.opened.static_view import StaticViewBuilder
from relume.methods.registry import METHODS
from relume.output.render_image import render_image
from relume.scene.custom_camera import with_cameras
from relume.store.bake_protocol import Recipe
from relume.store.run_bake import bake_in_process

SIZE = (64, 40)


@pytest.fixture(scope="session")
def fixed(method, free_bake, scene, tmp_path_factory):
    """A separate bake with a fixed view from `moved_camera`."""
    first = free_bake.views["front"].camera
    to_world = first.to_world.copy()
    to_world[:3, 3] += [0.4, 0.3, -0.2]
    placed = with_cameras(scene, [type(first)("front", to_world, first.yfov)])
    path = tmp_path_factory.mktemp("rest") / "fixed.zarr"
    bake_in_process(
        METHODS["gather"], placed, Recipe("gather", ("front",), SIZE, free_bake.light_transport.num_lights), path
    )
    return open_transfer(path, Cache(1 << 30))


@pytest.fixture
def picture(baked, scene, moved_camera):
    """A new picture from `moved_camera` with the look of these tests."""
    free_bake = open_bake(baked, Cache(1 << 30))
    new_picture = ProgressivePicture(
        FreeCameraPicture(free_bake, "front"),
        StaticViewBuilder(free_bake.light_transport, scene).make_static_view,
        free_bake.cache,
    )
    new_picture.set_look(make_look(free_bake, add_lights()))
    new_picture.set_camera(moved_camera, SIZE)
    return new_picture


def image_while_moving(picture):
    """The image that a user sees while the camera moves, once its light is complete."""
    source = picture._free_camera_picture
    watched = FreeCameraPicture(source._transfer, "front", is_watched=True)
    watched.set_look(source._look)
    watched.set_camera(*source.sized_camera)
    watched.advance(None)
    while (job := watched.next_job()) is not None and job.kind != "highlights":
        run_next_job(watched)
        watched.advance(None)
    return watched.image()


def surface_rmse(picture, image):
    """Relative RMS error of an image against the displayed one, over pixels that show surfaces."""
    height, width, _ = image.shape
    gbuffer = picture._free_camera_picture.gbuffer
    is_surface = (gbuffer.hits.face[: width * height] >= 0).reshape(height, width)
    return relative_rmse(image[is_surface], picture.image()[is_surface])


def finish_jobs(picture):
    """Run all pending jobs and return the change of the last step."""
    step = picture.advance(None)
    while picture.next_job() is not None:
        run_next_job(picture)
        step = picture.advance(None)
    return step


OFTEN, LONG = (None, "all at once"), ("a curve drawn", "a light moved", "the environment turned")


@pytest.mark.parametrize("edit", [*OFTEN, *(pytest.param(edit, marks=pytest.mark.slow) for edit in LONG)])
def test_direct_light_equals_that_of_a_fixed_bake_bit_for_bit(free_bake, fixed, picture, edit):
    changes = [EDITS[edit][1]] if edit else []
    look = make_look(free_bake, add_lights(*changes, edit_transport(show="direct")))
    picture.set_look(look)
    step = finish_jobs(picture)
    assert (step.exact, step.fidelity) == (True, "exact")
    np.testing.assert_array_equal(picture.image(), render_image(fixed, "front", look))


def test_indirect_light_differs_only_by_the_patches(free_bake, fixed, picture):
    look = make_look(free_bake, add_lights(edit_transport(show="first_bounce")))
    picture.set_look(look)
    finish_jobs(picture)
    expected = render_image(fixed, "front", look)
    assert relative_rmse(picture.image(), expected) < 0.05
    assert picture.image().mean() == pytest.approx(expected.mean(), rel=0.02)


def test_free_camera_picture_remains_until_the_static_view_is_exact_and_returns_with_the_camera(
    picture, moved_camera, free_bake
):
    assert picture.advance(None).fidelity == "approximate"
    first, moving = picture.image().copy(), image_while_moving(picture)
    for _ in range(2):
        while not (step := picture.advance(None)).exact:
            run_next_job(picture)
        assert step.changed
        assert step.free_camera_error.rms == pytest.approx(surface_rmse(picture, moving), rel=1e-3)
        assert 0 < step.free_camera_error.rms < 0.5
        assert 0 < step.free_camera_error.delta_e < 20
        assert picture.advance(None).free_camera_error is None
        assert not picture.advance(None).changed
        picture.set_camera(free_bake.views["front"].camera, (48, 36))
        step = picture.advance(None)
        assert (step.fidelity, picture.image().shape) == ("approximate", (36, 48, 3))
        picture.set_camera(moved_camera, SIZE)
        assert picture.advance(None).fidelity == "approximate"
        np.testing.assert_array_equal(picture.image(), first)


def test_edits_continue_in_the_static_view_and_pending_edits_are_applied(picture, free_bake, fixed):
    job = picture.next_job()
    assert job.is_refinement
    made = job.run(lambda share: None, lambda: False)
    direct = edit_transport(show="direct")
    picture.set_look(make_look(free_bake, add_lights(set_floor_color, direct)))
    picture.prepare(LOBE)
    job.apply(made)
    assert finish_jobs(picture).exact
    expected = render_image(fixed, "front", make_look(free_bake, add_lights(set_floor_color, direct)))
    assert relative_rmse(picture.image(), expected) < 1e-5
    look = make_look(free_bake, add_lights(set_floor_color, draw_curve, direct))
    picture.set_look(look, active_pointer=LOBE)
    assert picture.advance(None).changed  # immediately: the active curve was frozen
    finish_jobs(picture)
    assert relative_rmse(picture.image(), render_image(fixed, "front", look)) < 1e-5
    assert picture.highlight_pixels(LOBE, 0, 90).any()
    assert picture.inspect(30, 36)["material"] == "Floor"


def test_static_view_of_an_earlier_camera_is_discarded(picture, free_bake):
    job = picture.next_job()
    made = job.run(lambda share: None, lambda: False)
    picture.set_camera(free_bake.views["front"].camera, SIZE)
    assert picture.next_job().key != job.key
    job.apply(made)
    assert picture.advance(None).fidelity == "approximate"


def test_static_view_reports_progress_and_resumes(picture, monkeypatch):
    monkeypatch.setattr("relume.live.opened.static_view._ROWS_PER_TASK", 64)  # many more tasks than run at once
    run_next_job(picture)  # the correction, for which shadow rays are traced
    job, shares = picture.next_job(), []
    with pytest.raises(CancelledError):
        job.run(shares.append, lambda: len(shares) > 1)
    assert 0 < shares[0] < 0.5
    again = []
    job.run(again.append, lambda: False)
    assert again[0] > shares[-1]
    assert again == sorted(again)
    assert again[-1] == 1


def test_same_camera_is_encoded_again_without_tracing(picture, moved_camera):
    finish_jobs(picture)
    before = picture.image().copy()
    picture.set_camera(moved_camera, SIZE)
    step = picture.advance(None)
    assert step.changed
    assert step.exact
    np.testing.assert_array_equal(picture.image(), before)
    assert picture.next_job() is None


def test_static_view_starts_only_if_the_camera_is_idle(picture, moved_camera):
    picture.set_camera(moved_camera, SIZE, is_idle=False)
    assert picture.advance(None).fidelity == "approximate"
    assert picture.next_job() is None
    picture.set_camera(moved_camera, SIZE, is_idle=True)
    assert kind_of(picture.next_job()) == "direct light"


def test_free_camera_picture_remains_without_memory_for_a_static_view(baked, scene, moved_camera):
    free_bake = open_bake(baked, Cache(100_000))
    picture = ProgressivePicture(
        FreeCameraPicture(free_bake, "front"),
        StaticViewBuilder(free_bake.light_transport, scene).make_static_view,
        free_bake.cache,
    )
    picture.set_look(make_look(free_bake, add_lights(edit_light("Panel", enabled=False))))
    picture.set_camera(moved_camera, SIZE)
    picture.advance(None)
    for kind in ("direct light", "static view"):
        assert kind_of(run_next_job(picture)) == kind
    assert picture.next_job() is None
    assert picture.advance(None).fidelity == "approximate"


@pytest.fixture
def corrected(picture, moved_camera, monkeypatch):
    """A darkened picture after its correction, and its image before."""

    def darkened(transfer, wanted, visible, camera, size, shares):
        frame = render_frame(transfer, wanted, visible, camera, size, shares)
        is_hit = visible.hits.face[: size[0] * size[1]].reshape(size[1], size[0], 1) >= 0
        return frame._replace(image=np.where(is_hit, np.float32(0.8) * frame.image, frame.image))

    for user in ("free_camera_picture", "highlight_edges"):
        monkeypatch.setattr(f"relume.live.free_camera.{user}.render_frame", darkened)
    picture.set_camera(moved_camera, SIZE)
    picture.advance(None)
    moving, job = image_while_moving(picture), picture.next_job()
    assert kind_of(job) == "direct light"
    job.apply(job.run(lambda share: None, lambda: False))
    return picture, moving


def test_exact_direct_light_corrects_the_free_camera_picture(corrected):
    picture, moving = corrected
    step = picture.advance(None)
    assert (step.exact, step.fidelity, step.free_camera_error, step.changed) == (False, "approximate", None, True)
    assert picture.array_blocks() is None  # client-side shaders have no correction
    first = picture.image().copy()
    assert kind_of(picture.next_job()) == "static view"
    step = finish_jobs(picture)
    assert step.exact
    assert step.free_camera_error.rms == pytest.approx(surface_rmse(picture, moving), rel=1e-3)
    assert step.free_camera_error.rms > 0.1
    assert surface_rmse(picture, first) < 0.4 * step.free_camera_error.rms


def test_a_corrected_picture_has_exact_direct_light_and_its_own_indirect_light(picture, free_bake, fixed, moved_camera):
    picture.set_camera(moved_camera, SIZE)
    picture.advance(None)
    run_next_job(picture)
    picture.advance(None)
    looks = [make_look(free_bake, add_lights(*changes)) for changes in ((), (edit_transport(show="direct"),))]
    moving = []
    for look in looks:
        alone = FreeCameraPicture(free_bake, "front")
        alone.set_look(look)
        alone.set_camera(moved_camera, SIZE)
        alone.advance(None)
        moving.append(alone.image())
    expected = np.maximum(moving[0] - moving[1] + render_image(fixed, "front", looks[1]), 0)
    np.testing.assert_allclose(picture.image(), expected, rtol=1e-4, atol=1e-5)
    before, after = moving[0], picture.image()
    finish_jobs(picture)
    assert relative_rmse(after, picture.image()) < relative_rmse(before, picture.image())


def test_direct_light_alone_is_not_corrected_before_it_is_exact(picture, free_bake):
    picture.set_look(make_look(free_bake, add_lights(edit_transport(show="direct"))))
    picture.advance(None)
    assert kind_of(picture.next_job()) == "static view"


@pytest.mark.parametrize("is_edit", [True, False], ids=["a curve drawn", "the camera moved"])
def test_a_correction_is_valid_for_one_look_and_camera(corrected, free_bake, is_edit):
    picture, _ = corrected
    assert picture.advance(None).changed
    alone = FreeCameraPicture(free_bake, "front")
    look, camera_and_size = make_look(free_bake, add_lights(draw_curve)), (free_bake.views["front"].camera, SIZE)
    if is_edit:
        picture.set_look(look, active_pointer=LOBE)
        alone.set_look(look)
        alone.set_camera(*picture._free_camera_picture.sized_camera)
    else:
        picture.set_camera(*camera_and_size)
        alone.set_look(make_look(free_bake, add_lights()))
        alone.set_camera(*camera_and_size)
    assert picture.advance(None).changed
    alone.advance(None)
    np.testing.assert_array_equal(picture.image(), alone.image())
    assert kind_of(picture.next_job()) == "direct light"


@pytest.fixture
def traced_stages(monkeypatch):
    """The traced stages: shadows and gather rays."""
    stages, write = [], ExtendedStore.write

    def record(store, task, output):
        stages.append(task.stage)
        write(store, task, output)

    monkeypatch.setattr(ExtendedStore, "write", record)
    return stages


def test_gather_rays_are_traced_once_when_a_look_shows_indirect_light(free_bake, picture, traced_stages):
    straight, whole = (
        make_look(free_bake, add_lights(edit_transport(show="direct"))),
        make_look(free_bake, add_lights()),
    )
    picture.set_look(straight)
    assert finish_jobs(picture).exact
    assert set(traced_stages) == {1}
    picture.set_look(whole)
    assert picture.advance(None).fidelity == "approximate"
    assert finish_jobs(picture).exact
    first, num_traced = picture.image().copy(), len(traced_stages)
    assert set(traced_stages) == {1, 3}
    for look in (straight, whole):
        picture.set_look(look)
        assert finish_jobs(picture).exact
    assert len(traced_stages) == num_traced
    assert relative_rmse(picture.image(), first) < 1e-5


def test_indirect_light_is_added_to_a_static_view_begun_without_it(free_bake, picture, traced_stages):
    whole = make_look(free_bake, add_lights())
    picture.set_look(make_look(free_bake, add_lights(edit_transport(show="direct"))))
    job = picture.next_job()
    made = job.run(lambda share: None, lambda: False)
    picture.set_look(whole)
    job.apply(made)
    assert picture.advance(None).fidelity == "approximate"
    assert finish_jobs(picture).exact
    assert traced_stages == sorted(traced_stages)


def test_moving_camera_has_no_highlight_brush(picture):
    picture.advance(None)
    with pytest.raises(ResultUnavailableError, match="when the camera stops"):
        picture.highlight_pixels("/materials/Floor/terms/0/curves/theta_i", 0.0, 9.0)
