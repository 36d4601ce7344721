"""Annotated shapes are checked in tests."""

from __future__ import annotations

import numpy as np
import pytest
from jaxtyping import Shaped
from numpy.typing import NDArray
from shape_checks import ShapeError, with_checks

F32 = NDArray[np.float32]


def weighted_mean(
    position: Shaped[F32, "n 3"], weight: Shaped[F32, " n"] | None = None
) -> tuple[Shaped[F32, " 3"], float]:
    mean = np.average(position, axis=0, weights=weight)
    return (mean[:2] if np.isnan(mean).any() else mean), 1.0


def zeros(*shape: int) -> F32:
    return np.zeros(shape, np.float32)


def test_matching_shapes_pass() -> None:
    call = with_checks(weighted_mean)  # type: ignore[arg-type]
    assert call(zeros(4, 3))[1] == 1
    assert call(zeros(4, 3), weight=zeros(4) + 1)[1] == 1


@pytest.mark.parametrize(
    ("arrays", "name"),
    [
        ((zeros(4, 2),), "position"),
        ((zeros(4),), "position"),
        ((zeros(3, 3) + np.nan,), "return"),
    ],
)
def test_mismatched_shapes_fail(arrays: tuple[F32, ...], name: str) -> None:
    with pytest.raises(ShapeError, match=f"weighted_mean: {name} is"):
        with_checks(weighted_mean)(*arrays)  # type: ignore[arg-type]


def test_sizes_of_one_name_agree() -> None:
    def dot(a: Shaped[F32, " n"], b: Shaped[F32, " n"]) -> float:
        return len(a) + len(b)

    with pytest.raises(ShapeError, match="b is"):
        with_checks(dot)(zeros(3), zeros(4))  # type: ignore[arg-type]
