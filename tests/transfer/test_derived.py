"""Images kept beside a store: found by whoever wants the same, forgotten where they grow too large, never trusted."""

from __future__ import annotations

import os

import numpy as np
import pytest
from pictures import opened, sigma
from sessions import look_of

from relume.look import LightGeometry
from relume.transfer import need
from relume.transfer.derived import DerivedImages
from relume.transfer.light import Light, Source, is_moved_by_hand
from relume.transfer.shade import Shaded

SHAPE = (1, 3, 64)
FILE_BYTES = 128 + 4 * 3 * 64


def shaded(value):
    return Shaded(np.full(SHAPE, value, np.float32))


def refuse():
    raise AssertionError("it is made again")


def test_images_used_longest_ago_are_forgotten(tmp_path):
    images = DerivedImages(tmp_path, 2 * FILE_BYTES)
    for second, key in enumerate(("a", "b")):
        known = set(tmp_path.iterdir())
        images.get(key, SHAPE, lambda key=key: shaded(ord(key)))
        (path,) = set(tmp_path.iterdir()) - known
        os.utime(path, (second, second))
    assert images.get("a", SHAPE, refuse).image[0, 0, 0] == ord("a")  # and so it is the newest
    images.get("c", SHAPE, lambda: shaded(ord("c")))
    assert len(list(tmp_path.glob("*.npy"))) == 2
    images.get("a", SHAPE, refuse)
    with pytest.raises(AssertionError, match="made again"):
        images.get("b", SHAPE, refuse)


def test_a_damaged_image_is_made_again(tmp_path):
    images = DerivedImages(tmp_path)
    images.get("a", SHAPE, lambda: shaded(1))
    (path,) = tmp_path.iterdir()
    path.write_bytes(path.read_bytes()[:200])
    assert images.get("a", SHAPE, lambda: shaded(2)).image.max() == 2
    assert images.get("a", SHAPE, refuse).image.max() == 2


def test_the_image_of_an_edited_look_is_there_after_a_restart(transfer, monkeypatch):
    look = look_of(transfer, sigma(0.23456))
    before = opened(transfer, look=look).image()
    monkeypatch.setattr(need, "shade", lambda *args: refuse())
    np.testing.assert_array_equal(opened(transfer, look=look).image(), before)
    with pytest.raises(AssertionError, match="made again"):
        opened(transfer, look=look_of(transfer, sigma(0.23457)))


def test_another_look_is_told_from_a_hand_by_how_much_differs():
    a, b, c = (Source(LightGeometry("point", position=(x, 1.0, 0.0)), (1.0, 1.0, 1.0)) for x in (0.0, 1.0, 2.0))
    look = Light(None, ((0.1,), (0.2,), (0.3,)), None, (a, b))
    assert is_moved_by_hand(look, look._replace(local=(a, c)))
    assert is_moved_by_hand(look, look._replace(reflectances=((0.1,), (0.5,), (0.3,))))
    assert not is_moved_by_hand(look, look._replace(local=(c,), reflectances=((0.1,), (0.5,), (0.3,))))
    assert not is_moved_by_hand(look, look._replace(reflectances=((0.4,), (0.5,), (0.3,))))
    assert not is_moved_by_hand(look, look._replace(local=(c,)))
