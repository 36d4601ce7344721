"""Images stored with a bake: found by every user of the same image, evicted by age, always verified."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest
from exact_pictures import DERIVED_FOLDERS
from picture_edits import open_exact_picture, set_sigma
from session_edits import BUDGET, make_look

from relume.core.cache import Cache
from relume.live.fixed_camera.strategies.shading import Shading
from relume.live.opened import fixed_views as transfer_module
from relume.live.opened.openers import open_transfer
from relume.operators.image_cache import ImageFiles
from relume.operators.shade import ShadedTerm

SHAPE = (1, 3, 64)
FILE_BYTES = 128 + 4 * 3 * 64
CODE, OTHER = "0123456789abcdef", "fedcba9876543210"


def shaded(value):
    return ShadedTerm(np.full(SHAPE, value, np.float32))


def refuse():
    raise AssertionError("it is made again")


def test_least_recently_used_images_are_deleted(tmp_path):
    images, folder = ImageFiles(tmp_path, CODE, 2 * FILE_BYTES), tmp_path / CODE
    folder.mkdir()
    for second, key in enumerate(("a", "b")):
        files = set(folder.iterdir())
        images.get(key, SHAPE, lambda key=key: shaded(ord(key)))
        (path,) = set(folder.iterdir()) - files
        os.utime(path, (second, second))
    assert images.get("a", SHAPE, refuse).image[0, 0, 0] == ord("a")  # now the most recently used
    images.get("c", SHAPE, lambda: shaded(ord("c")))
    assert len(list(folder.glob("*.npy"))) == 2
    images.get("a", SHAPE, refuse)
    with pytest.raises(AssertionError, match="made again"):
        images.get("b", SHAPE, refuse)


def test_a_damaged_image_is_computed_again(tmp_path):
    images = ImageFiles(tmp_path, CODE)
    images.get("a", SHAPE, lambda: shaded(1))
    (path,) = (tmp_path / CODE).iterdir()
    path.write_bytes(path.read_bytes()[:200])
    assert images.get("a", SHAPE, lambda: shaded(2)).image.max() == 2
    assert images.get("a", SHAPE, refuse).image.max() == 2


def test_images_of_other_code_are_ignored_and_deleted_with_the_first_write(tmp_path):
    (tmp_path / "of_no_code.npy").write_bytes(b"kept before images were named by code")
    before, after = ImageFiles(tmp_path, OTHER), ImageFiles(tmp_path, CODE)
    before.get("a", SHAPE, lambda: shaded(1))
    assert before.has("a")
    assert not after.has("a")
    assert after.get("a", SHAPE, lambda: shaded(2)).image.max() == 2
    assert [path.name for path in tmp_path.iterdir()] == [CODE]
    assert after.get("a", SHAPE, refuse).image.max() == 2


def test_after_an_upgrade_images_are_computed_again(baked, tmp_path, monkeypatch):
    store = shutil.copytree(baked, tmp_path / "store.zarr", ignore=shutil.ignore_patterns(*DERIVED_FOLDERS))
    made, finished = [], Shading._complete_image

    def counted(*args):
        made.append(1)
        return finished(*args)

    monkeypatch.setattr(Shading, "_complete_image", counted)
    open_exact_picture(open_transfer(store, Cache(BUDGET)))
    num_images = len(made)
    assert num_images > 0
    open_exact_picture(open_transfer(store, Cache(BUDGET)))
    assert len(made) == num_images
    monkeypatch.setattr(transfer_module, "image_code", lambda: OTHER)
    open_exact_picture(open_transfer(store, Cache(BUDGET)))
    assert len(made) == 2 * num_images


def test_the_image_of_an_edited_look_survives_a_restart(transfer, monkeypatch):
    look = make_look(transfer, set_sigma(0.23456))
    before = open_exact_picture(transfer, look=look).image()
    monkeypatch.setattr(Shading, "_complete_image", lambda *args: refuse())
    np.testing.assert_array_equal(open_exact_picture(transfer, look=look).image(), before)
    with pytest.raises(AssertionError, match="made again"):
        open_exact_picture(transfer, look=make_look(transfer, set_sigma(0.23457)))
