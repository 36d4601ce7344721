"""Requirements on free-camera pictures of every method."""

import numpy as np
import pytest
from free_camera_pictures import finish_refinement, make_picture, make_watched_picture, run_job
from look_edits import (
    EDITS,
    LOBE,
    add_lights,
    draw_curve,
    edit_environment,
    edit_light,
    edit_transport,
    remove_glossy_term,
    replace_terms,
    set_exponent,
    set_floor_color,
)
from session_edits import make_look, relative_rmse

from relume.core.errors import NotFoundError, ParameterError
from relume.live.free_camera.free_camera_picture import FreeCameraPicture
from relume.reference import reference_image

ROUNDED = 1e-4  # float32 sums of one thousand lights in another order


@pytest.mark.parametrize("edit", EDITS)
def test_edited_picture_equals_a_new_one_and_undo_leaves_no_trace(free_bake, edit):
    _, change = EDITS[edit]
    picture = make_picture(free_bake)
    before = picture.image()
    picture.set_look(make_look(free_bake, add_lights(change)))
    assert picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), make_picture(free_bake, change).image())
    picture.set_look(make_look(free_bake, add_lights()))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), before)


@pytest.mark.parametrize(
    "change",
    [draw_curve, set_exponent(60.0), set_floor_color, remove_glossy_term, replace_terms],
    ids=lambda function: function.__name__,
)
def test_only_the_edited_material_is_evaluated_again(free_bake, change, monkeypatch):
    """With camera and light unchanged, the picture and the encoded tiles equal those of a new picture."""
    direct = edit_transport(show="direct")
    picture = make_watched_picture(free_bake, direct)
    picture.encode(picture.all_tiles(), "rgb9e5")
    before = picture.image()
    with monkeypatch.context() as nothing_whole:
        nothing_whole.setattr("relume.live.free_camera.free_camera_picture.render_frame", None)
        picture.set_look(make_look(free_bake, add_lights(direct, change)))
        assert picture.advance(None).changed
    anew = make_watched_picture(free_bake, direct, change)
    np.testing.assert_array_equal(picture.image(), anew.image())
    assert picture.encode(picture.all_tiles(), "rgb9e5") == anew.encode(anew.all_tiles(), "rgb9e5")
    differs = (picture.image() != before).any(axis=2)
    assert differs.any()
    assert not differs.all()


def test_highlights_are_refined_when_camera_and_light_stop(free_bake, moved_camera, monkeypatch):
    """Twice: the second time after an edit, without a whole frame; a moving camera does not wait for refinement."""
    direct = edit_transport(show="direct")
    picture = make_watched_picture(free_bake, direct)
    at_first, job = picture.image(), picture.next_job()
    for value in (40, 90):
        with monkeypatch.context() as nothing_whole:
            nothing_whole.setattr("relume.live.free_camera.free_camera_picture.render_frame", None)
            picture.set_look(make_look(free_bake, add_lights(direct, set_exponent(value))))
            assert picture.advance(None).changed
        finish_refinement(picture)
        assert picture.next_job() is None
        np.testing.assert_array_equal(picture.image(), make_picture(free_bake, direct, set_exponent(value)).image())
    picture.set_look(make_look(free_bake, add_lights(direct)))
    for camera in (moved_camera, free_bake.views["front"].camera):
        picture.set_camera(camera, (48, 36))
        picture.advance(None)
    np.testing.assert_array_equal(picture.image(), at_first)
    job.apply(run_job(job))  # for an outdated frame
    assert not picture.advance(None).changed
    assert picture.next_job().key != job.key
    coarse, fine = (show(free_bake, direct, replace_terms).image() for show in (make_watched_picture, make_picture))
    assert relative_rmse(coarse, fine) > 1e-3


def test_picture_does_not_depend_on_earlier_cameras(free_bake, moved_camera):
    picture = make_picture(free_bake)
    before = picture.image()
    picture.set_camera(moved_camera, (64, 40))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), make_picture(free_bake, camera=moved_camera, size=(64, 40)).image())
    assert picture.image().shape == (40, 64, 3)
    picture.set_camera(free_bake.views["front"].camera, (48, 36))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), before)


def test_picture_is_never_exact_and_becomes_idle(free_bake):
    picture = FreeCameraPicture(free_bake, "front")
    picture.set_look(make_look(free_bake))
    first, second = picture.advance(None), picture.advance(None)
    assert (first.changed, first.exact, first.fidelity, first.complete) == (True, False, "approximate", True)
    assert not second.changed
    assert picture.next_job() is None


def test_no_light_is_black_and_doubled_light_doubles_the_picture(free_bake):
    dark = (edit_environment(intensity=0.0), edit_light("Bulb", enabled=False), edit_light("Panel", intensity=0.0))
    assert not make_picture(free_bake, *dark).image().any()
    twice = (edit_environment(intensity=2.0), edit_light("Bulb", intensity=2.0), edit_light("Panel", intensity=2.0))
    np.testing.assert_allclose(
        make_picture(free_bake, *twice).image(), 2 * make_picture(free_bake).image(), rtol=ROUNDED, atol=ROUNDED
    )


def test_solo_free_camera_pictures_sum_to_the_whole(free_bake):
    diffuse = (
        "Floor",
        "Wall",
    )  # negative values are clamped to zero: the sum needs materials without ringing highlights

    def plain(document):
        for name in diffuse:
            document["materials"][name]["terms"] = [{"model": "lambert", "color": [0.5, 0.4, 0.3], "params": {}}]

    whole, total = make_picture(free_bake, plain).image(), 0
    for source in ("Bulb", "Panel", None):
        off = [edit_light(name, enabled=False) for name in ("Bulb", "Panel") if name != source]
        alone = make_picture(free_bake, plain, *off, edit_environment(intensity=float(source is None))).image()
        assert alone.any()
        total = total + alone
    np.testing.assert_allclose(total, whole, rtol=ROUNDED, atol=ROUNDED)


@pytest.mark.parametrize("pointer", ["/materials/Nowhere/terms/0/curves/theta_h", LOBE.replace("1", "7"), "nonsense"])
def test_invalid_pointers_are_rejected_without_change(free_bake, pointer):
    picture = make_picture(free_bake)
    with pytest.raises(ParameterError):
        picture.prepare(pointer)
    assert not picture.advance(None).changed


def test_missing_environment_is_rejected_without_change(free_bake):
    picture = make_picture(free_bake)
    before = picture.image()
    look = make_look(free_bake, add_lights(set_floor_color))
    gone = look.environment.model_copy(update={"map": "env:0123456789abcdef"})
    with pytest.raises(NotFoundError):
        picture.set_look(look.model_copy(update={"environment": gone}))
    assert not picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), before)


def test_pixel_probe_reports_the_displayed_radiance(free_bake):
    picture = make_picture(free_bake)
    inspection = picture.inspect(24, 33)
    assert inspection["material"] == "Floor"
    assert abs(inspection["position"][1]) < 1e-3
    np.testing.assert_allclose(inspection["normal"], [0, 1, 0], atol=1e-5)
    np.testing.assert_array_equal(inspection["radiance"], picture.image()[33, 24])
    with pytest.raises(ParameterError):
        picture.inspect(48, 0)


@pytest.mark.parametrize("show", ["direct", "all"])
def test_diffuse_light_from_a_new_camera_matches_the_reference(scene, free_bake, moved_camera, show):
    """Direct light of soft sources, and indirect light; five percent with the dense probes of a small scene."""

    def plain(document):
        curves = {"theta_o": {"points": [[0, 1.5], [90, 0.5]]}}
        wall = {"model": "lambert", "color": [0.2, 0.3, 0.5], "params": {}, "curves": curves}
        document["materials"]["Wall"]["terms"] = [wall]

    changes = (plain, edit_light("Panel", enabled=False), edit_light("Bulb", enabled=False), edit_transport(show=show))
    look = make_look(free_bake, add_lights(*changes))
    passes = [
        reference_image(_with(scene, moved_camera), "front", look, (48, 36), 64, pass_index=k, reflects=True)
        for k in range(4)
    ]
    reference, noise = np.mean(passes, axis=0), np.std(passes, axis=0).mean() / 2
    actual = make_picture(free_bake, *changes, camera=moved_camera).image()
    inner = ~_edges(make_picture(free_bake, *changes, camera=moved_camera))
    assert relative_rmse(actual[inner], reference[inner]) < 0.05
    assert abs(actual[inner].mean() / reference[inner].mean() - 1) < 0.01 + 4 * noise / reference.mean()


def _with(scene, camera):
    from relume.scene.custom_camera import with_cameras

    return with_cameras(scene, [camera])


def _edges(picture):
    """Pixels beside a different surface: the reference averages both. (height, width)"""
    height, width, _ = picture.image().shape
    names = np.array([[str(picture.inspect(x, y)["material"]) for x in range(width)] for y in range(height)])
    edge = np.zeros((height, width), bool)
    edge[1:] |= names[1:] != names[:-1]
    edge[:, 1:] |= names[:, 1:] != names[:, :-1]
    edge[:-1] |= names[1:] != names[:-1]
    edge[:, :-1] |= names[:, 1:] != names[:, :-1]
    return edge
