"""What pictures whose eyes move promise, whatever method they are of."""

import numpy as np
import pytest
from looks_of_pictures import EDITS, LOBE, drawn, environment, exponent, light, lit, matt, painted, replaced, transport
from sessions import look_of, relative_rmse

from relume.errors import CancelledError, ChunkDamagedError, NotFoundError, ParameterError
from relume.memory import Memory
from relume.methods.harmonic_light import read_harmonic_light
from relume.methods.registry import open_bake
from relume.methods.store_io import read_cells
from relume.moving.fine_job import FineJob
from relume.moving.picture import MovingPicture
from relume.reference import reference_image
from relume.scene.model import Camera
from relume.store import open_store

ROUNDED = 1e-4  # of sums of a thousand lights in float32, in another order


def seen(moving, *changes, eye=None, size=(48, 36)):
    picture = MovingPicture(moving, "front")
    picture.set_look(look_of(moving, lit(*changes)))
    if eye is not None:
        picture.set_eye(eye, size)
    picture.advance(None)
    return picture


@pytest.fixture
def aside(moving):
    """An eye that nobody baked."""
    first = moving.views["front"].camera
    to_world = first.to_world.copy()
    to_world[:3, 3] += [0.4, 0.3, -0.2]
    return Camera("front", to_world, first.yfov)


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


@pytest.mark.parametrize("edit", ["a lamp moved", "the environment turned", "fewer paths", "all at once"])
def test_light_that_moves_is_rough_at_first_and_at_rest_as_if_nobody_had_watched(moving, edit):
    _, change = EDITS[edit]
    other = environment(rotation=11.0 * (1 + list(EDITS).index(edit)))  # nobody has asked for its light before
    picture = MovingPicture(moving, "front", is_watched=True)
    picture.set_look(look_of(moving, lit(change, other)))
    assert picture.advance(None).fidelity == "preview"
    rough = picture.image()
    assert not picture.advance(None).changed
    job = picture.next_job()
    assert job.refines
    with pytest.raises(CancelledError):
        job.make(lambda share: None, lambda: True)
    shares = []
    picture.install(job, job.make(shares.append, lambda: False))
    assert shares == sorted(shares)
    assert shares[-1] == 1
    assert picture.next_job() is None
    assert picture.advance(None).fidelity == "approximate"
    rest(picture)
    exact = seen(moving, change, other).image()
    np.testing.assert_array_equal(picture.image(), exact)
    assert relative_rmse(rough, exact) < 0.3


def test_bakes_that_know_no_harmonics_follow_light_too(baked, moving, monkeypatch):
    turned = environment(rotation=203.0)

    def rough(of):
        picture = MovingPicture(of, "front", is_watched=True)
        picture.set_look(look_of(of, lit(turned)))
        assert picture.advance(None).fidelity == "preview"
        return picture.image()

    harmonic = rough(moving)
    monkeypatch.setattr("relume.methods.transfer.read_harmonic_light", lambda store, cells: None)
    plain = rough(open_bake(baked, Memory(1 << 30)))
    assert 0 < relative_rmse(harmonic, plain) < 0.04


def test_harmonics_that_do_not_fit_the_points_are_refused(baked, moving):
    store = open_store(baked)

    class Damaged:
        attributes, shape = store.attributes, store.shape

        def read(self, path, start=0, stop=None):
            found = store.read(path, start, stop)
            return found[:-1] if path == "harmonics/weight" else found

    with pytest.raises(ChunkDamagedError, match="harmonics"):
        read_harmonic_light(Damaged(), read_cells(store))


FOLLOWED = {
    "a highlight's exponent": (LOBE, exponent(60)),
    "a curve drawn": (LOBE, drawn),
    "a diffuse colour": ("/materials/Floor/terms/0/color", painted),
    "a metal in place of a wall": (None, replaced),
    "fewer paths": (None, transport(bounces=1)),
    "all of them": (LOBE, lambda document: [change(document) for change in (drawn, painted, transport(bounces=2))]),
}


@pytest.mark.parametrize("edit", FOLLOWED)
@pytest.mark.parametrize("solo", [None, frozenset({"Lamp"})])
def test_light_that_surfaces_send_follows_a_hand(moving, edit, solo):
    """Under a light that is known, a frame is what was exact and what surfaces send otherwise, made beside the frames;
    at rest all is exact."""
    pointer, change = FOLLOWED[edit]
    other = environment(rotation=100.0 + 2 * list(FOLLOWED).index(edit) + (solo is None))  # known to nobody else

    def shown(*changes):
        return look_of(moving, lit(other, *changes))

    picture = MovingPicture(moving, "front", is_watched=True)
    picture.set_look(shown(), solo=solo)
    picture.advance(None)
    rest(picture)
    before = picture.image()
    if pointer is not None:
        picture.touch(pointer)
    picture.set_look(shown(change), solo=solo)
    assert picture.advance(None).fidelity == "preview"
    stale = picture.image()  # of surfaces as they are, in what they sent each other before
    job = picture.next_job()
    assert not job.refines
    picture.install(job, made(job))
    assert picture.advance(None).fidelity == "preview"
    seen = picture.image()
    find_light(picture)
    assert np.linalg.norm(seen - picture.image()) < 0.1 * np.linalg.norm(stale - picture.image())
    rest(picture)
    exact = picture.image()
    alone = MovingPicture(moving, "front")
    alone.set_look(shown(change), solo=solo)
    alone.advance(None)
    np.testing.assert_array_equal(exact, alone.image())
    picture.set_look(shown(), solo=solo)
    assert picture.advance(None).fidelity == "approximate"  # it is known
    rest(picture)
    np.testing.assert_array_equal(picture.image(), before)


def begun(moving, *changes):
    """A picture that somebody watches, all its light there, its highlights not found finely yet."""
    picture = MovingPicture(moving, "front", is_watched=True)
    picture.set_look(look_of(moving, lit(*changes)))
    picture.advance(None)
    find_light(picture)
    return picture


def find_light(picture):
    """What follows when a hand rests, but for fine highlights."""
    while not isinstance(job := picture.next_job(), FineJob):
        picture.install(job, made(job))
        picture.advance(None)


def made(job):
    return job.make(lambda share: None, lambda: False)


def test_edits_wait_for_no_light_and_light_for_no_edits(moving, monkeypatch):
    """Twice: an edit changes a part of the frame, and what was begun before it comes to all of it afterwards."""
    other = environment(rotation=301.0)
    picture = begun(moving, other)
    picture.set_look(look_of(moving, lit(other, exponent(30))))
    picture.advance(None)
    for step in (60, 90):
        job, before = picture.next_job(), picture.image()
        with monkeypatch.context() as nothing_whole:
            nothing_whole.setattr("relume.moving.picture.frame_of", None)
            nothing_whole.setattr("relume.moving.vectors.live.changed", None)
            picture.set_look(look_of(moving, lit(other, exponent(step))))
            assert picture.advance(None).changed
        edited = picture.image()
        assert (edited != before).any()
        picture.install(job, made(job))
        assert picture.advance(None).changed
        assert (picture.image() != edited).any()
        assert picture.next_job().key != job.key  # of the newer look
    rest(picture)
    np.testing.assert_array_equal(picture.image(), seen(moving, exponent(90), other).image())


def test_what_surfaces_send_is_behind_a_light_that_turns_and_catches_up(moving):
    turns = [look_of(moving, lit(environment(rotation=turn))) for turn in (310.0, 318.0, 326.0)]
    picture = begun(moving, environment(rotation=310.0))
    picture.set_look(turns[1])
    picture.advance(None)
    job, behind = picture.next_job(), picture.image()
    assert not job.refines
    picture.set_look(turns[2])
    picture.advance(None)
    picture.install(job, made(job))
    picture.advance(None)
    job = picture.next_job()
    picture.install(job, made(job))
    assert picture.advance(None).fidelity == "preview"
    assert picture.next_job().refines
    caught_up = picture.image()
    at_once = MovingPicture(moving, "front", is_watched=True)
    at_once.set_look(turns[2])
    at_once.advance(None)
    np.testing.assert_allclose(caught_up, at_once.image(), rtol=ROUNDED, atol=ROUNDED)
    assert relative_rmse(behind, caught_up) > 1e-3
    rest(picture)
    np.testing.assert_array_equal(picture.image(), seen(moving, environment(rotation=326.0)).image())


def test_an_eye_that_moves_finds_light_from_surfaces_wherever_it_looks(moving, aside):
    """The light turns, and the eye moves before what surfaces send is there: no point is left without."""
    picture = begun(moving, environment(rotation=331.0))
    now = look_of(moving, lit(environment(rotation=339.0)))
    picture.set_look(now)
    picture.advance(None)
    job = picture.next_job()
    picture.set_eye(aside, (64, 40))
    picture.advance(None)
    before = picture.image()
    picture.install(job, made(job))
    picture.advance(None)
    at_once = MovingPicture(moving, "front", is_watched=True)
    at_once.set_look(now)
    at_once.set_eye(aside, (64, 40))
    at_once.advance(None)
    np.testing.assert_allclose(picture.image(), at_once.image(), rtol=ROUNDED, atol=ROUNDED)
    assert 0 < relative_rmse(before, at_once.image()) < 0.1


def test_a_shader_gets_what_follows(moving):
    def bounces(*changes):
        return look_of(moving, lit(environment(rotation=171.0), *changes))

    def sent(picture):
        found = {}
        for name, part in picture.parts()[0].items():
            if name.startswith("vectors/"):
                light = part.make()
                scale, num = light[f"{name}/scale"][0]
                numbers = light[name].astype(np.float32).reshape(-1, -(-3 * int(num) // 4) * 4)
                found[name, int(num)] = scale * numbers[:, : 3 * int(num)]
        return found

    picture = MovingPicture(moving, "front", is_watched=True)
    picture.draws = False
    picture.set_look(bounces())
    picture.advance(None)
    rest(picture)
    picture.set_look(bounces(painted, exponent(8.0)))
    assert picture.advance(None).fidelity == "preview"
    job = picture.next_job()
    picture.install(job, made(job))
    assert picture.advance(None).fidelity == "preview"
    followed = sent(picture)
    rest(picture)
    exact = sent(picture)
    assert followed.keys() == exact.keys()
    assert {num for _, num in exact} == {1, 36}  # a diffuse floor, a wall with a highlight
    for (name, num), values in exact.items():
        irradiance = slice(None, None, num)  # the first function of each channel
        assert 0 < relative_rmse(followed[name, num][:, irradiance], values[:, irradiance]) < 0.01


def rest(picture):
    """As when a hand rests."""
    while (job := picture.next_job()) is not None:
        picture.install(job, made(job))
        picture.advance(None)
    assert picture.advance(None).fidelity == "approximate"


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
