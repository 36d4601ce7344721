"""Files without anything to show say why, in whole sentences."""

from __future__ import annotations

import pytest

from relume.core.import_warnings import unsupported
from relume.scene.finalize import MAX_REFUSAL, no_triangles


@pytest.mark.parametrize(
    ("lengths", "ending"),
    [
        ((), " (it is empty)"),
        ((20, 30), f" ({'a' * 20}; {'b' * 30})"),
        ((100, 90, 200, 100), f" ({'a' * 100}; {'b' * 90}; and 2 more)"),
        ((400,), " (nothing in it is supported)"),
    ],
)
def test_as_many_faults_are_named_as_fit(lengths, ending):
    faults = [unsupported(letter * length + ".") for letter, length in zip("abcd", lengths, strict=False)]
    message = no_triangles([*faults, *faults], "it is empty")
    assert message.endswith(ending)
    assert len(message) <= MAX_REFUSAL + 20
