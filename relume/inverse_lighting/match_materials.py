"""Match materials and lights to a target: Gauss–Newton over the materials, with the lights solved for.

For the positions u of parameters in [0, 1], and the strengths x(u) that are best with them, minimize

    Σ_p w_p (I_p(u, x(u)) − t_p)² / Σ_p w_p t_p² + λ Σ_k (u_k − u⁰_k)²

by variable projection (Golub and Pereyra 1973). Kaufman's derivative (1975): a change of a material adds its finite
difference ∂I/∂u_k · h to the constant of the image, and the strengths are solved for again. SciPy's trust region damps
the steps as Levenberg and Marquardt do, and keeps them inside the limits.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import replace
from functools import partial

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray
from scipy.optimize import least_squares

from relume.inverse_lighting.match_lights import Match
from relume.inverse_lighting.material_parameters import (
    MaterialParameter,
    material_parameters,
    positions_of,
    with_positions,
)
from relume.inverse_lighting.solve import Target, valid_target
from relume.inverse_lighting.sources import RenderLook, Sources, merge_changes, replace_operations
from relume.look import Look

F64 = NDArray[np.float64]
MAX_STEPS = 12
"""Steps at most; each renders an image of each source, and one of each parameter."""
_DIFFERENCE = 0.02  # of a position: above the rounding of indirect light, which ignores small changes of materials
_TOLERANCE = 1e-3  # of positions, and of the error relative to itself
_GRADIENT_TOLERANCE = 1e-6  # of the squared relative error: pictures without noise are never reached exactly
_CHANGED = 1e-3  # least change of a position that counts
LoadSources = Callable[[Look], Sources]
MatchSources = Callable[[Sources], Match]


def match_materials(
    look: Look,
    names: Collection[str],
    render: RenderLook,
    load: LoadSources,
    target: Target,
    match: MatchSources,
    ridge: float,
) -> Look:
    """Return the look with the materials that come nearest to a target together with its lights, which stay here.

    Args:
        look: the look. names: materials that may change. render: renders a look. load: loads its sources.
        target: the target. match: solves for the lights. ridge: λ.
    Raises:
        ParameterError: as `material_parameters`.
    """
    parameters = material_parameters(look, names)
    start = positions_of(look, parameters)
    problem = _Problem(look, parameters, start, render, load, target, match, ridge)
    solution = least_squares(
        problem.residuals,
        start,
        problem.derivatives,
        bounds=(0.0, 1.0),
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_GRADIENT_TOLERANCE,
        max_nfev=MAX_STEPS,
    )
    changed = np.abs(solution.x - start) > _CHANGED
    return with_positions(look, [each for each, k in zip(parameters, changed, strict=True) if k], solution.x[changed])


class _Problem:
    """Residuals of positions, and their derivatives."""

    def __init__(
        self,
        look: Look,
        parameters: tuple[MaterialParameter, ...],
        start: F64,
        render: RenderLook,
        load: LoadSources,
        target: Target,
        match: MatchSources,
        ridge: float,
    ) -> None:
        self._at = partial(with_positions, look, parameters)
        self._start, self._render, self._load_look, self._match, self._ridge = start, render, load, match, ridge
        self._radiance, weights = valid_target(target)
        self._scales = np.sqrt(weights)[..., None] / (np.linalg.norm(np.sqrt(weights)[..., None] * self._radiance) or 1)
        self._positions, self._sources = start, load(look)

    def residuals(self, positions: F64) -> Shaped[F64, " residuals"]:
        """Return the residuals of pixels, and those of the ridge."""
        return np.concatenate(
            [self._errors(self._match(self._load(positions))), np.sqrt(self._ridge) * (positions - self._start)]
        )

    def derivatives(self, positions: F64) -> Shaped[F64, "residuals parameters"]:
        """Return the derivatives of the residuals by forward differences, backward at the upper limit."""
        sources = self._load(positions)
        match = self._match(sources)
        before, image = self._errors(match), self._image(positions, match)
        columns = []
        for k, position in enumerate(positions):
            moved = positions.copy()
            moved[k] += _DIFFERENCE if position + _DIFFERENCE <= 1.0 else -_DIFFERENCE
            added = self._image(moved, match) - image
            after = self._errors(self._match(replace(sources, constant=sources.constant + added)))
            columns.append((after - before) / (moved[k] - position))
        return np.vstack([np.stack(columns, axis=-1), np.sqrt(self._ridge) * np.eye(len(positions))])

    def _load(self, positions: F64) -> Sources:
        if not np.array_equal(positions, self._positions):
            self._positions, self._sources = positions.copy(), self._load_look(self._at(positions))
        return self._sources

    def _image(self, positions: F64, match: Match) -> NDArray[np.float32]:
        """Image with the lights of a match."""
        document = merge_changes(self._at(positions).model_dump(), replace_operations(match.changes))
        return self._render(Look.model_validate(document))[..., :3]

    def _errors(self, match: Match) -> F64:
        return np.asarray(self._scales * (match.image - self._radiance), np.float64).reshape(-1)
