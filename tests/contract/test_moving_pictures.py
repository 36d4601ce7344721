"""What pictures whose eyes move promise, whatever method they are of."""

import numpy as np
import pytest
from looks_of_pictures import EDITS, LOBE, drawn, environment, exponent, light, lit, matt, painted, replaced, transport
from moving_pictures import begun, made, rest, seen
from sessions import look_of, relative_rmse

from relume.errors import NotFoundError, ParameterError
from relume.moving.picture import MovingPicture
from relume.reference import reference_image

ROUNDED = 1e-4  # of sums of a thousand lights in float32, in another order


@pytest.mark.parametrize("edit", EDITS)
def test_an_edited_picture_is_that_of_the_look_from_nothing_and_leaves_no_trace(moving, edit):
    _, change = EDITS[edit]
    picture = seen(moving)
    before = picture.image()
    picture.set_look(look_of(moving, lit(change)))
    assert picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), seen(moving, change).image())
    picture.set_look(look_of(moving, lit()))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), before)


@pytest.mark.parametrize("change", [drawn, exponent(60.0), painted, matt, replaced], ids=lambda one: one.__name__)
def test_an_edited_material_alone_is_evaluated_anew(moving, change, monkeypatch):
    """While eye and light stay: the picture, and what is sent of it, are those of the look from nothing."""
    direct = transport(show="direct")
    picture = begun(moving, direct)
    picture.encode(picture.all_tiles(), "rgb9e5")
    before = picture.image()
    with monkeypatch.context() as nothing_whole:
        nothing_whole.setattr("relume.moving.picture.frame_of", None)
        picture.set_look(look_of(moving, lit(direct, change)))
        assert picture.advance(None).changed
    anew = begun(moving, direct, change)
    np.testing.assert_array_equal(picture.image(), anew.image())
    assert picture.encode(picture.all_tiles(), "rgb9e5") == anew.encode(anew.all_tiles(), "rgb9e5")
    differs = (picture.image() != before).any(axis=2)
    assert differs.any()
    assert not differs.all()


def test_highlights_are_found_finely_once_eye_and_light_rest(moving, aside, monkeypatch):
    """Twice, the second time after an edit, which costs no whole frame; no eye that moves waits for them."""
    direct = transport(show="direct")
    picture = begun(moving, direct)
    at_first, job = picture.image(), picture.next_job()
    for value in (40, 90):
        with monkeypatch.context() as nothing_whole:
            nothing_whole.setattr("relume.moving.picture.frame_of", None)
            picture.set_look(look_of(moving, lit(direct, exponent(value))))
            assert picture.advance(None).changed
        rest(picture)
        assert picture.next_job() is None
        np.testing.assert_array_equal(picture.image(), seen(moving, direct, exponent(value)).image())
    picture.set_look(look_of(moving, lit(direct)))
    for eye in (aside, moving.views["front"].camera):
        picture.set_eye(eye, (48, 36))
        picture.advance(None)
    np.testing.assert_array_equal(picture.image(), at_first)
    picture.install(job, made(job))  # of a frame that is gone
    assert not picture.advance(None).changed
    assert picture.next_job().key != job.key
    coarse, fine = (show(moving, direct, replaced).image() for show in (begun, seen))
    assert relative_rmse(coarse, fine) > 1e-3


def test_a_picture_does_not_depend_on_where_its_eye_was(moving, aside):
    picture = seen(moving)
    before = picture.image()
    picture.set_eye(aside, (64, 40))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), seen(moving, eye=aside, size=(64, 40)).image())
    assert picture.image().shape == (40, 64, 3)
    picture.set_eye(moving.views["front"].camera, (48, 36))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), before)


def test_it_never_says_that_it_is_exact_and_rests(moving):
    picture = MovingPicture(moving, "front")
    picture.set_look(look_of(moving))
    first, second = picture.advance(None), picture.advance(None)
    assert (first.changed, first.exact, first.fidelity, first.complete) == (True, False, "approximate", True)
    assert not second.changed
    assert picture.next_job() is None


def test_no_light_is_black_and_twice_the_light_twice_the_picture(moving):
    dark = (environment(scale=0.0), light("Lamp", on=False), light("Panel", scale=0.0))
    assert not seen(moving, *dark).image().any()
    twice = (environment(scale=2.0), light("Lamp", scale=2.0), light("Panel", scale=2.0))
    np.testing.assert_allclose(seen(moving, *twice).image(), 2 * seen(moving).image(), rtol=ROUNDED, atol=ROUNDED)


def test_solos_of_all_sources_sum_to_the_whole(moving):
    diffuse = ("Floor", "Wall")  # what is below nothing is held at nothing: no highlight that rings may be divided

    def plain(document):
        for name in diffuse:
            document["materials"][name]["terms"] = [{"model": "lambert", "color": [0.5, 0.4, 0.3], "params": {}}]

    whole, total = seen(moving, plain).image(), 0
    for source in ("Lamp", "Panel", None):
        off = [light(name, on=False) for name in ("Lamp", "Panel") if name != source]
        alone = seen(moving, plain, *off, environment(scale=float(source is None))).image()
        assert alone.any()
        total = total + alone
    np.testing.assert_allclose(total, whole, rtol=ROUNDED, atol=ROUNDED)


@pytest.mark.parametrize("pointer", ["/materials/Nowhere/terms/0/curves/theta_h", LOBE.replace("1", "7"), "nonsense"])
def test_what_points_to_nothing_is_refused_and_changes_nothing(moving, pointer):
    picture = seen(moving)
    with pytest.raises(ParameterError):
        picture.touch(pointer)
    assert not picture.advance(None).changed


def test_an_environment_that_is_not_here_is_refused_and_changes_nothing(moving):
    picture = seen(moving)
    before = picture.image()
    look = look_of(moving, lit(painted))
    gone = look.environment.model_copy(update={"map": "env:0123456789abcdef"})
    with pytest.raises(NotFoundError):
        picture.set_look(look.model_copy(update={"environment": gone}))
    assert not picture.advance(None).changed
    np.testing.assert_array_equal(picture.image(), before)


def test_a_pixel_says_what_it_shows(moving):
    picture = seen(moving)
    found = picture.probe(24, 33)
    assert found["material"] == "Floor"
    assert abs(found["position"][1]) < 1e-3
    np.testing.assert_allclose(found["normal"], [0, 1, 0], atol=1e-5)
    np.testing.assert_array_equal(found["radiance"], picture.image()[33, 24])
    with pytest.raises(ParameterError):
        picture.probe(48, 0)


@pytest.mark.parametrize("show", ["direct", "all"])
def test_diffuse_light_from_elsewhere_is_that_of_brute_force(scene, moving, aside, show):
    """Direct light of soft sources, and reflected: the points of a small scene lie close enough for five per cent."""

    def plain(document):
        curves = {"theta_o": {"points": [[0, 1.5], [90, 0.5]]}}
        wall = {"model": "lambert", "color": [0.2, 0.3, 0.5], "params": {}, "curves": curves}
        document["materials"]["Wall"]["terms"] = [wall]

    changes = (plain, light("Panel", on=False), light("Lamp", on=False), transport(show=show))
    look = look_of(moving, lit(*changes))
    passes = [
        reference_image(_with(scene, aside), "front", look, (48, 36), 64, pass_index=k, reflects=True) for k in range(4)
    ]
    truth, noise = np.mean(passes, axis=0), np.std(passes, axis=0).mean() / 2
    found = seen(moving, *changes, eye=aside).image()
    inner = ~_edges(seen(moving, *changes, eye=aside))
    assert relative_rmse(found[inner], truth[inner]) < 0.05
    assert abs(found[inner].mean() / truth[inner].mean() - 1) < 0.01 + 4 * noise / truth.mean()


def _with(scene, camera):
    from relume.scene.placed_camera import with_cameras

    return with_cameras(scene, [camera])


def _edges(picture):
    """Pixels beside one that shows something else: brute force sees parts of both. (height, width)"""
    height, width, _ = picture.image().shape
    names = np.array([[str(picture.probe(x, y)["material"]) for x in range(width)] for y in range(height)])
    edge = np.zeros((height, width), bool)
    edge[1:] |= names[1:] != names[:-1]
    edge[:, 1:] |= names[:, 1:] != names[:, :-1]
    edge[:-1] |= names[1:] != names[:-1]
    edge[:, :-1] |= names[:, 1:] != names[:, :-1]
    return edge
