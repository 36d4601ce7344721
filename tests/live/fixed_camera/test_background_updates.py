"""Background and objects change to a new environment together, during any sequence of edits."""

from __future__ import annotations

import numpy as np
import pytest
from environment_files import dusk, write_map
from exact_pictures import exact_image
from session_edits import BUDGET, kind_of, make_look, relative_rmse, run_next_job, run_until_exact

from relume.assets.environments.environment_store import STORE, store_environment
from relume.core.cache import Cache
from relume.live.fixed_camera.picture import Picture
from relume.live.fixed_camera.view_images import ViewImages
from relume.views.view import View

COLORS = np.eye(3)


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A red, a green and a blue environment: a picture of one light has one color."""
    folder = tmp_path_factory.mktemp("maps")
    with STORE.with_search_folder(tmp_path_factory.mktemp("library")) as library:
        white = dusk() / [1.0, 0.4, 0.2]
        paths = [write_map(folder / f"{name}.exr", white * c) for name, c in zip("rgb", COLORS, strict=True)]
        yield [store_environment(library, path, path.stem).reference for path in paths]


@pytest.fixture(params=["transfer", "gathered"])
def opened(request):
    """A bake of environment light with textures, and one with indirect light."""
    return request.getfixturevalue(request.param)


@pytest.fixture(autouse=True)
def few(monkeypatch):
    """Previews of few samples, like those of large images."""
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._NUM_SHADED", 300)


def lit_by(maps, number, *, light_position=None, sigma=None, **environment):
    """A change of the look: one of the maps, a light of the same color at a position, a curve."""

    def change(document):
        document["environment"].update(map=maps[number], **environment)
        if light_position is not None:
            emission = (3 * COLORS[number]).tolist()
            document["lights"]["Lamp"] = {"kind": "point", "position": [light_position, 1.2, 0.9], "emission": emission}
        if sigma is not None:
            terms = [term for material in document["materials"].values() for term in material["terms"]]
            next(term for term in terms if "sigma" in term["params"])["params"]["sigma"] = sigma

    return change


def colors_of(picture):
    """Channels with any light."""
    return np.flatnonzero(picture.image().reshape(-1, 3).max(axis=0) > 0).tolist()


def start(transfer, look, **options):
    picture = Picture(transfer, "front", Cache(BUDGET), **options)
    picture.set_look(look)
    return picture


def test_a_new_environment_appears_everywhere_at_once(opened, maps):
    red, blue = (make_look(opened, lit_by(maps, k)) for k in (0, 2))
    picture = run_until_exact(start(opened, red))
    before = picture.image()
    picture.set_look(blue)
    still = picture.advance(None)
    assert (still.tiles, still.exact, still.fidelity, still.complete) == ([], False, "approximate", True)
    np.testing.assert_array_equal(picture.image(), before)
    assert kind_of(run_next_job(picture)) == "preview"
    come = picture.advance(None)
    assert (come.fidelity, come.complete) == ("preview", True)
    assert colors_of(picture) == [2]
    while not picture.advance(None).exact:
        run_next_job(picture)
        picture.advance(None)
        assert colors_of(picture) == [2]
    np.testing.assert_array_equal(picture.image(), exact_image(opened, blue))


def test_without_memory_for_a_preview_the_old_picture_stays(transfer, maps):
    picture = Picture(transfer, "front", Cache(200_000))
    picture.set_look(make_look(transfer, lit_by(maps, 0)))
    before = run_until_exact(picture).image()
    picture.set_look(make_look(transfer, lit_by(maps, 1)))
    while not picture.advance(None).exact:
        np.testing.assert_array_equal(picture.image(), before)
        assert kind_of(run_next_job(picture)) != "preview"
    assert colors_of(picture) == [1]


def test_a_material_color_does_not_wait_for_light(transfer, maps):
    picture = run_until_exact(start(transfer, make_look(transfer, lit_by(maps, 0))))
    before = picture.image()

    def painted(document):
        lit_by(maps, 1)(document)
        document["materials"]["Ball"]["terms"][1]["color"] = [0.1, 0.1, 0.1]

    picture.set_look(make_look(transfer, painted))
    assert picture.advance(None).changed
    assert colors_of(picture) == [0]
    assert not np.array_equal(picture.image(), before)


def test_the_gain_of_an_environment_appears_with_its_light(transfer, maps):
    """Next to local lights the gain is part of the light, without them it multiplies the picture."""
    picture = run_until_exact(start(transfer, make_look(transfer, lit_by(maps, 0, intensity=4.0))))
    before = picture.image()
    picture.set_look(make_look(transfer, lit_by(maps, 0, light_position=0.6, intensity=4.0)))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), before)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in (1, 2))])
def test_continuous_edits_never_mix_two_lights(opened, maps, seed):
    """Maps swapped, rotated, dimmed, lights added and moved, curves edited, undo, in random order."""
    rng = np.random.default_rng(seed)

    def any_look():
        number, light_position = int(rng.integers(3)), rng.uniform(-0.6, 0.6) if rng.random() < 0.6 else None
        sigma = rng.uniform(0.1, 0.4) if rng.random() < 0.3 else None
        rotated, intensity = float(rng.choice([0.0, 0.0, 40.0])), float(rng.choice([1.0, 1.0, 0.5]))
        return make_look(
            opened,
            lit_by(maps, number, light_position=light_position, sigma=sigma, rotation=rotated, intensity=intensity),
        )

    looks = [any_look()]
    picture, changes = run_until_exact(start(opened, looks[0])), 0
    shown = colors_of(picture)
    for _ in range(60):
        if rng.random() < 0.4:
            looks.append(looks[rng.integers(len(looks))] if rng.random() < 0.3 else any_look())
            picture.set_look(looks[-1])
        if picture.next_job() is not None and rng.random() < 0.8:
            need = picture.next_job()
            made = need.run(lambda fraction: None, lambda: False)
            if rng.random() < 0.4:  # the edit continues meanwhile
                looks.append(any_look())
                picture.set_look(looks[-1])
            need.apply(made)
        advance = picture.advance(8)
        assert advance.complete
        assert len(colors_of(picture)) == 1, "a picture of two lights"
        changes += colors_of(picture) != shown
        shown = colors_of(picture)
    assert changes > 3
    expected = exact_image(opened, looks[-1])
    assert relative_rmse(run_until_exact(picture).image(), expected) < 3e-3


def test_an_opened_picture_is_complete_at_once_and_then_shaded(opened, maps, monkeypatch):
    look = make_look(opened, lit_by(maps, 1, rotation=77.0))
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._MAX_SHADED_AT_ONCE", 100)
    picture = start(opened, look, is_watched=True)
    nothing = picture.advance(None)
    assert (nothing.complete, nothing.fidelity) == (False, "preview")
    assert kind_of(run_next_job(picture)) == "preview"
    whole = picture.advance(None)
    assert (whole.complete, whole.fidelity, whole.exact) == (True, "preview", False)
    while kind_of(picture.next_job()) == "preview":
        run_next_job(picture)
    expected = exact_image(opened, look)
    picture.advance(None)
    assert relative_rmse(picture.image(), expected) < 0.5
    assert picture.next_job().is_refinement
    np.testing.assert_array_equal(run_until_exact(picture).image(), expected)


def test_direct_light_is_shown_before_indirect_light(gathered, maps, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._MAX_SHADED_AT_ONCE", 100)
    monkeypatch.setattr("relume.live.fixed_camera.strategies.dense_light._MAX_PAIRS", 0)  # direct light is unchanged
    lit = lit_by(maps, 1, rotation=33.0)

    def show_direct(document):
        lit(document)
        document["transport"] = {**document.get("transport", {}), "show": "direct"}

    looks = make_look(gathered, show_direct), make_look(gathered, lit)
    direct, all_light = (exact_image(gathered, look) for look in looks)
    read, some_rays = [], View.subset_rays
    monkeypatch.setattr(View, "subset_rays", lambda *given: read.append(given) or some_rays(*given))
    first, of_direct = (start(gathered, look, is_watched=True) for look in reversed(looks))
    for picture in (first, of_direct):
        picture.advance(None)
        assert kind_of(run_next_job(picture)) == "preview"
        assert picture.advance(None).complete
    assert not read
    before = first.image()
    np.testing.assert_array_equal(before, of_direct.image())
    assert kind_of(run_next_job(first)) == "preview"
    first.advance(None)
    assert read
    assert relative_rmse(first.image() - before, all_light - direct) < 0.4


def test_a_curve_edit_is_shown_while_light_is_computed(transfer, maps, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._MAX_SHADED_AT_ONCE", 100)
    picture = start(transfer, make_look(transfer, lit_by(maps, 1)), is_watched=True)
    run_next_job(picture)
    picture.prepare("/materials/Ball/terms/1/curves/theta_h")
    picture.set_look(make_look(transfer, lit_by(maps, 1, sigma=0.3)))
    assert not picture.next_job().is_refinement


def test_a_picture_with_stored_images_opens_without_a_preview(transfer, maps, monkeypatch):
    monkeypatch.setattr("relume.live.fixed_camera.strategies.sparse_preview._MAX_SHADED_AT_ONCE", 100)
    look = make_look(transfer, lit_by(maps, 2))
    run_until_exact(start(transfer, look))
    assert kind_of(start(transfer, look, is_watched=True).next_job()) != "preview"


def test_emission_is_updated_only_when_light_changes(transfer, maps, monkeypatch):
    picture, calls = run_until_exact(start(transfer, make_look(transfer, lit_by(maps, 0)))), []
    shine = ViewImages.set_emission
    monkeypatch.setattr(ViewImages, "set_emission", lambda *given: calls.append(given) or shine(*given))
    for sigma, light_position in ((0.2, None), (0.3, None), (0.3, 0.4)):
        picture.set_look(make_look(transfer, lit_by(maps, 0, sigma=sigma, light_position=light_position)))
        run_until_exact(picture)
        assert len(calls) == (light_position is not None)


def test_the_gain_of_an_old_preview_is_discarded(transfer):
    """Environment light without local lights changes only in brightness: the factor of a preview is discarded."""

    def look(**environment):
        return make_look(transfer, lambda document: document["environment"].update(environment))

    picture = run_until_exact(start(transfer, look(), is_watched=True))
    picture.set_look(look(rotation=40.0))
    run_next_job(picture)
    run_until_exact(picture).set_look(look(rotation=40.0, intensity=4.0))
    bright = run_until_exact(picture).image()
    picture.set_look(look(rotation=60.0, intensity=4.0))
    picture.advance(None)
    np.testing.assert_array_equal(picture.image(), bright)
