"""What a moving picture becomes when its eye rests: that of a fixed view baked there, and what edits make of that."""

import numpy as np
import pytest
from look_edits import EDITS, LOBE, add_lights, draw_curve, edit_light, edit_transport, set_floor_color
from session_edits import make_look, relative_rmse, run_next_job

from relume.core.cache import Cache
from relume.core.errors import CancelledError, ResultUnavailableError
from relume.live.free_camera.frame import render_frame
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.live.free_camera.refinement.progressive_picture import ProgressivePicture
from relume.live.free_camera.refinement.refinement_jobs import SparseExactJob, StaticViewJob
from relume.methods.registry import METHODS, open_bake, open_transfer
from relume.methods.static_view import StaticTracing, StaticViewBuilder
from relume.output.render_image import render_image
from relume.scene.custom_camera import with_cameras
from relume.store import bake_in_process
from relume.store.bake_protocol import Recipe

SIZE = (64, 40)


@pytest.fixture(scope="session")
def fixed(method, moving, scene, tmp_path_factory):
    """A bake of a fixed view from `aside`, made apart from all that moves."""
    first = moving.views["front"].camera
    to_world = first.to_world.copy()
    to_world[:3, 3] += [0.4, 0.3, -0.2]
    placed = with_cameras(scene, [type(first)("front", to_world, first.yfov)])
    path = tmp_path_factory.mktemp("rest") / "fixed.zarr"
    bake_in_process(
        METHODS["gather"], placed, Recipe("gather", ("front",), SIZE, moving.light_transport.num_lights), path
    )
    return open_transfer(path, Cache(1 << 30))


@pytest.fixture
def picture(baked, scene, aside):
    """From `aside`, under the look of these tests; nothing of it has been made."""
    moving = open_bake(baked, Cache(1 << 30))
    new_picture = ProgressivePicture(
        FreeCameraPicture(moving, "front"),
        StaticViewBuilder(moving.light_transport, scene).make_static_view,
        moving.cache,
    )
    new_picture.set_look(make_look(moving, add_lights()))
    new_picture.set_camera(aside, SIZE)
    return new_picture


def rested(picture):
    """Make all that waits; returns what the last step changed."""
    step = picture.advance(None)
    while picture.next_job() is not None:
        run_next_job(picture)
        step = picture.advance(None)
    return step


OFTEN, LONG = (None, "all at once"), ("a curve drawn", "a lamp moved", "the environment turned")


@pytest.mark.parametrize("edit", [*OFTEN, *(pytest.param(edit, marks=pytest.mark.slow) for edit in LONG)])
def test_straight_light_is_that_of_a_fixed_bake_to_the_bit(moving, fixed, picture, edit):
    changes = [EDITS[edit][1]] if edit else []
    look = make_look(moving, add_lights(*changes, edit_transport(show="direct")))
    picture.set_look(look)
    step = rested(picture)
    assert (step.exact, step.fidelity) == (True, "exact")
    np.testing.assert_array_equal(picture.image(), render_image(fixed, "front", look))


def test_reflected_light_is_that_of_other_cells(moving, fixed, picture):
    look = make_look(moving, add_lights(edit_transport(show="first_bounce")))
    picture.set_look(look)
    rested(picture)
    expected = render_image(fixed, "front", look)
    assert relative_rmse(picture.image(), expected) < 0.05
    assert picture.image().mean() == pytest.approx(expected.mean(), rel=0.02)


def test_the_moving_picture_stands_until_the_still_is_exact_and_comes_back_with_the_eye(picture, aside, moving):
    assert picture.advance(None).fidelity == "approximate"
    first = picture.image().copy()
    for _ in range(2):
        while not (step := picture.advance(None)).exact:
            run_next_job(picture)
        assert step.changed
        assert step.previous_error == pytest.approx(relative_rmse(first, picture.image()), rel=1e-3)
        assert 0 < step.previous_error < 0.5
        assert picture.advance(None).previous_error is None
        assert not picture.advance(None).changed
        picture.set_camera(moving.views["front"].camera, (48, 36))
        step = picture.advance(None)
        assert (step.fidelity, picture.image().shape) == ("approximate", (36, 48, 3))
        picture.set_camera(aside, SIZE)
        assert picture.advance(None).fidelity == "approximate"
        np.testing.assert_array_equal(picture.image(), first)


def test_edits_go_on_in_the_still_and_those_made_meanwhile_are_kept(picture, moving, fixed):
    job = picture.next_job()
    assert job.is_refinement
    made = job.run(lambda share: None, lambda: False)
    direct = edit_transport(show="direct")
    picture.set_look(make_look(moving, add_lights(set_floor_color, direct)))
    picture.prepare(LOBE)
    picture.install(job, made)
    assert rested(picture).exact
    expected = render_image(fixed, "front", make_look(moving, add_lights(set_floor_color, direct)))
    assert relative_rmse(picture.image(), expected) < 1e-5
    look = make_look(moving, add_lights(set_floor_color, draw_curve, direct))
    picture.set_look(look, active_pointer=LOBE)
    assert picture.advance(None).changed  # at once: the curve in hand was frozen
    rested(picture)
    assert relative_rmse(picture.image(), render_image(fixed, "front", look)) < 1e-5
    assert picture.highlight_pixels(LOBE, 0, 90).any()
    assert picture.inspect(30, 36)["material"] == "Floor"


def test_a_still_of_another_eye_is_of_no_use(picture, moving):
    job = picture.next_job()
    made = job.run(lambda share: None, lambda: False)
    picture.set_camera(moving.views["front"].camera, SIZE)
    assert picture.next_job().key != job.key
    picture.install(job, made)
    assert picture.advance(None).fidelity == "approximate"


def test_it_tells_how_far_it_is_and_goes_on_from_where_it_was_given_up(picture, monkeypatch):
    monkeypatch.setattr("relume.methods.static_view._ROWS_PER_TASK", 512)
    job, shares = picture.next_job(), []
    with pytest.raises(CancelledError):
        job.run(shares.append, lambda: len(shares) > 3)
    assert shares[0] == 0
    again = []
    job.run(again.append, lambda: False)
    assert again[0] > shares[-1]
    assert again == sorted(again)
    assert again[-1] == 1


def test_the_same_eye_again_is_sent_again_and_traced_no_more(picture, aside):
    rested(picture)
    before = picture.image().copy()
    picture.set_camera(aside, SIZE)
    step = picture.advance(None)
    assert step.changed
    assert step.exact
    np.testing.assert_array_equal(picture.image(), before)
    assert picture.next_job() is None


def test_who_does_not_want_it_has_the_moving_picture(picture, aside):
    picture.set_camera(aside, SIZE, is_idle=False)
    assert picture.advance(None).fidelity == "approximate"
    assert picture.next_job() is None
    picture.set_camera(aside, SIZE, is_idle=True)
    assert isinstance(picture.next_job(), StaticViewJob)


def test_with_too_little_memory_the_moving_picture_stays(baked, scene, aside):
    moving = open_bake(baked, Cache(100_000))
    picture = ProgressivePicture(
        FreeCameraPicture(moving, "front"),
        StaticViewBuilder(moving.light_transport, scene).make_static_view,
        moving.cache,
    )
    picture.set_look(make_look(moving, add_lights(edit_light("Panel", enabled=False))))
    picture.set_camera(aside, SIZE)
    picture.advance(None)
    run_next_job(picture)
    assert picture.next_job() is None
    assert picture.advance(None).fidelity == "approximate"


@pytest.fixture
def few_at_once(picture, aside, monkeypatch):
    """The same, darker than it should be, with exact samples at every fourth pixel: found, shaded, and shown."""

    def darkened(transfer, wanted, visible, camera, size, shares):
        frame = render_frame(transfer, wanted, visible, camera, size, shares)
        is_hit = visible.hits.face[: size[0] * size[1]].reshape(size[1], size[0], 1) >= 0
        return frame._replace(image=np.where(is_hit, np.float32(0.8) * frame.image, frame.image))

    for user in ("free_camera_picture", "refine_job"):
        monkeypatch.setattr(f"relume.live.free_camera.{user}.render_frame", darkened)
    monkeypatch.setattr("relume.live.free_camera.refinement.refinement_jobs.SAMPLE_SPACING", 4)
    picture.set_camera(aside, (160, 100))
    picture.advance(None)
    before, job = picture.image().copy(), picture.next_job()
    assert isinstance(job, SparseExactJob)
    picture.install(job, job.run(lambda share: None, lambda: False))
    return picture, before


def test_a_few_exact_samples_correct_the_moving_picture_until_the_still_is_there(few_at_once):
    picture, before = few_at_once
    step = picture.advance(None)
    assert (step.exact, step.fidelity, step.previous_error, step.changed) == (False, "approximate", None, True)
    assert picture.array_blocks() is None  # no shader elsewhere knows of it
    first = picture.image().copy()
    assert isinstance(picture.next_job(), StaticViewJob)
    step = rested(picture)
    assert step.exact
    assert step.previous_error == pytest.approx(relative_rmse(before, picture.image()), rel=1e-3)
    assert step.previous_error > 0.1
    assert relative_rmse(first, picture.image()) < 0.4 * step.previous_error


def test_where_the_moving_picture_is_right_few_samples_leave_it_alone(picture, aside, monkeypatch):
    monkeypatch.setattr("relume.live.free_camera.refinement.refinement_jobs.SAMPLE_SPACING", 4)
    picture.set_camera(aside, (160, 100))
    picture.advance(None)
    before = picture.image().copy()
    run_next_job(picture)
    first = picture.image().copy()
    rested(picture)
    assert relative_rmse(first, picture.image()) < 1.01 * relative_rmse(before, picture.image())


@pytest.mark.parametrize("is_edit", [True, False], ids=["a curve drawn", "the eye moved"])
def test_what_a_few_samples_said_is_of_one_look_and_one_eye(few_at_once, moving, is_edit):
    picture, _ = few_at_once
    assert picture.advance(None).changed
    alone = FreeCameraPicture(moving, "front")
    look, camera_and_size = make_look(moving, add_lights(draw_curve)), (moving.views["front"].camera, (160, 100))
    if is_edit:
        picture.set_look(look, active_pointer=LOBE)
        alone.set_look(look)
        alone.set_camera(*picture._free_camera_picture.sized_camera)
    else:
        picture.set_camera(*camera_and_size)
        alone.set_look(make_look(moving, add_lights()))
        alone.set_camera(*camera_and_size)
    assert picture.advance(None).changed
    alone.advance(None)
    np.testing.assert_array_equal(picture.image(), alone.image())
    assert isinstance(picture.next_job(), SparseExactJob)


@pytest.fixture
def traced(monkeypatch):
    """Stages of what is traced: shadows, and gather rays."""
    stages, trace = [], StaticTracing._trace

    def noted(tracing, task):
        stages.append(task.stage)
        trace(tracing, task)

    monkeypatch.setattr(StaticTracing, "_trace", noted)
    return stages


def test_gather_rays_are_traced_when_a_look_shows_their_light_and_then_no_more(moving, picture, traced):
    straight, whole = make_look(moving, add_lights(edit_transport(show="direct"))), make_look(moving, add_lights())
    picture.set_look(straight)
    assert rested(picture).exact
    assert set(traced) == {1}
    picture.set_look(whole)
    assert picture.advance(None).fidelity == "approximate"
    assert rested(picture).exact
    first, num_traced = picture.image().copy(), len(traced)
    assert set(traced) == {1, 3}
    for look in (straight, whole):
        picture.set_look(look)
        assert rested(picture).exact
    assert len(traced) == num_traced
    assert relative_rmse(picture.image(), first) < 1e-5


def test_reflected_light_asked_for_while_a_still_without_it_is_made(moving, picture, traced):
    whole = make_look(moving, add_lights())
    picture.set_look(make_look(moving, add_lights(edit_transport(show="direct"))))
    job = picture.next_job()
    made = job.run(lambda share: None, lambda: False)
    picture.set_look(whole)
    picture.install(job, made)
    assert picture.advance(None).fidelity == "approximate"
    assert rested(picture).exact
    assert traced == sorted(traced)


def test_while_the_eye_moves_no_curve_tells_what_it_lights(picture):
    picture.advance(None)
    with pytest.raises(ResultUnavailableError, match="when the camera stops"):
        picture.highlight_pixels("/materials/Floor/terms/0/curves/theta_i", 0.0, 9.0)
