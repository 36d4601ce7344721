"""Outgoing radiance of a bake's patches under the lights of its images, computed once for all of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination, Normals, equal_up_to_reflectances
from relume.live.fixed_camera.protocols import LightQuality, RaysToSamples
from relume.live.opened.patch_direct_light import DirectPatchLight
from relume.live.opened.planar_mirror_light import MirrorLightTransfer, VirtualLights
from relume.radiosity.highlight_transport import outgoing_in_highlights
from relume.radiosity.outgoing_radiance import OutgoingHighlights, OutgoingRadiance, isotropic_radiance
from relume.radiosity.patch_irradiance import PatchLight
from relume.radiosity.reflectance_operator import ReflectanceOperator
from relume.radiosity.solve_bounces import Directions, solve_bounces, solve_isotropic
from relume.transport.outgoing_patch_light import OutgoingLight
from relume.views.view import View

F32 = NDArray[np.float32]


class IndirectSolution(NamedTuple):
    """Outgoing radiance of patches, or its change; a `relume.live.fixed_camera.protocols.PatchRadiance`.

    Attributes:
        patches: the patches, with the normals that they were solved for. outgoing: their radiance.
        virtual_lights: in planar mirrors, which samples receive along rays of their own; None for none.
    """

    patches: PatchLight
    outgoing: OutgoingRadiance
    virtual_lights: VirtualLights | None = None

    def along_rays(self, *, is_smoothed: bool = True) -> OutgoingLight:
        """Tabulate the radiance for lookups along rays. is_smoothed: see `OutgoingRadiance.outgoing_light`"""
        return self.outgoing.outgoing_light(self.patches, is_smoothed=is_smoothed)

    def mean_to_others(self) -> Shaped[F32, "patches 3"]:
        """Return the mean radiance of each patch toward other patches."""
        return self.outgoing.mean_to_others(self.patches)

    def rays_to(self, view: View, material: int) -> RaysToSamples | None:
        """Return the light that samples of a material receive from virtual lights; None if there is none."""
        if self.virtual_lights is None or not self.virtual_lights.normal_irradiance.any():
            return None
        visible = view.mirror_lights(material)
        sample_indices = np.flatnonzero(visible.any(axis=1))
        return RaysToSamples(sample_indices, self.virtual_lights.rays(visible[sample_indices]))


class _Approximation(NamedTuple):
    """Approximations of a solution.

    Attributes:
        has_exact_lights: direct light of all samples and light triangles, and with the look's normal maps.
        has_sharp_highlights: tables of sharp highlights, else their low-degree basis.
        directions: of light between patches.
    """

    has_exact_lights: bool
    has_sharp_highlights: bool
    directions: Directions


_EXACT = _Approximation(True, True, Directions.EXACT)
_PREVIEW = _Approximation(False, False, Directions.BINNED)
_PREVIEW_FOR_RAYS = _Approximation(False, True, Directions.BINNED)
_EXACT_CHANGE = _Approximation(True, True, Directions.BINNED)
_CHANGE_OF_SURFACES = _Approximation(True, False, Directions.BINNED)
_ISOTROPIC = _Approximation(False, False, Directions.NONE)


class IndirectSolver:
    """Indirect illumination from patches; thread-safe.

    Args:
        direct_light: direct illumination of the patches.
        find_direct_light: returns the same for normal-map overrides, by the image of each material; polls a
            cancellation while it traces missing rays.
        mirror_light: virtual lights of planar mirrors; None if receivers get their light from the patches.
        cache: cache of results computed from the bake. key: key of the bake in it.
    """

    def __init__(
        self,
        direct_light: DirectPatchLight,
        find_direct_light: Callable[[Normals, Callable[[], bool]], DirectPatchLight],
        mirror_light: MirrorLightTransfer | None,
        cache: Cache,
        key: str,
    ) -> None:
        self._direct_light, self._find_direct_light = direct_light, find_direct_light
        self._mirror_light, self._cache, self._key = mirror_light, cache, key

    def solve_indirect(
        self,
        light: Illumination,
        quality: LightQuality,
        start_from: Illumination | None = None,
        is_canceled: Callable[[], bool] = lambda: False,
        *,
        is_for_rays: bool = False,
    ) -> IndirectSolution:
        """Solve for the outgoing radiance of all patches, or for its change.

            L = Σ_b L^b,   L^b = F t^b,   t^(b+1)(c) = π / N Σ_r L^b(hit(c, r), −ω_r) h(ω_r)

        t^0 is direct light, and b runs over the bounces of the light. L^1 excludes the light of planar mirrors that
        samples receive from virtual lights.

        Exact light from scratch leaves nothing out. Otherwise these are approximate, for a change at both ends alike,
        so that errors cancel:

        | quality | change | direct light | sharp highlights | directions between patches | late bounces |
        |---|---|---|---|---|---|
        | exact | any | | | bins | few rays |
        | preview | none | few samples, small maps | low degree | bins | few rays |
        | preview, for rays | none | few samples, small maps | tables, few samples | bins | few rays |
        | preview | surfaces | | low degree | bins | few rays |
        | preview | lights | few samples, small maps | low degree | none after the first bounce | few rays |

        All of them use the baked normals.

        Args:
            light: the illumination. quality: see above.
            start_from: light of an earlier solution; None: from scratch.
            is_canceled: polled while rays of overridden normals are traced.
            is_for_rays: only `IndirectSolution.along_rays` is used: means leave tables out.
        Raises:
            CancelledError: `is_canceled` returned true.
        """
        if start_from is None:
            preview = _PREVIEW_FOR_RAYS if is_for_rays else _PREVIEW
            approximation = preview if quality is LightQuality.PREVIEW else _EXACT
            return self._solve(_indirect_only(light), approximation, is_canceled)
        if quality is not LightQuality.PREVIEW:
            approximation = _EXACT_CHANGE
        elif equal_up_to_reflectances(start_from, light):
            approximation = _CHANGE_OF_SURFACES
        else:
            approximation = _ISOTROPIC
        before, after = (self._solve(_indirect_only(each), approximation, is_canceled) for each in (start_from, light))
        virtual_lights = None if self._mirror_light is None else self._mirror_light.virtual_lights(light, start_from)
        return IndirectSolution(after.patches, after.outgoing.subtract(before.outgoing), virtual_lights)

    def outgoing_light(
        self,
        light: Illumination,
        quality: LightQuality = LightQuality.EXACT,
        is_canceled: Callable[[], bool] = lambda: False,
    ) -> OutgoingLight:
        """Return the solution from scratch, tabulated for gather rays and cached.

        A preview is isotropic after the first reflection, which takes a sixth of the time: few of its samples show the
        difference.

        Args:
            light: the illumination. quality: of the solution. is_canceled: polled, see `solve_indirect`.
        """
        indirect, is_preview = _indirect_only(light), quality is LightQuality.PREVIEW
        approximation, cache = (_ISOTROPIC, self._cache.transient) if is_preview else (_EXACT, self._cache)

        def solve() -> OutgoingLight:
            return self._solve(indirect, approximation, is_canceled).along_rays()

        key = self._key, "indirect light", is_preview, indirect, self._has_mirror_light(indirect)
        return cache.get_value(key, solve)

    def _has_mirror_light(self, light: Illumination) -> bool:
        return self._mirror_light is not None and self._mirror_light.is_in(light)

    def _solve(
        self, light: Illumination, approximation: _Approximation, is_canceled: Callable[[], bool]
    ) -> IndirectSolution:
        is_exact, direct_light = approximation == _EXACT, self._direct_light
        if not light.paths.has_indirect:
            return IndirectSolution(
                direct_light.patches, isotropic_radiance(np.zeros((direct_light.patches.num_patches, 3), np.float32))
            )
        if is_exact and any(light.normals):
            direct_light = self._find_direct_light(light.normals, is_canceled)

        def compute() -> OutgoingRadiance:
            return self._bounces(light, approximation, direct_light)

        key = self._key, "indirect light, approximate", light, approximation
        outgoing = compute() if is_exact else self._cache.transient.get_value(key, compute)
        mirror_light = self._mirror_light
        if mirror_light is None or not mirror_light.is_in(light):
            return IndirectSolution(direct_light.patches, outgoing)
        mirror_part = mirror_light.patch_part(light, is_sharp=approximation.has_sharp_highlights)
        return IndirectSolution(
            direct_light.patches, outgoing.subtract(mirror_part), mirror_light.virtual_lights(light)
        )

    def _bounces(
        self, light: Illumination, approximation: _Approximation, direct_light: DirectPatchLight
    ) -> OutgoingRadiance:
        """Return the radiance of the patches, with all light of planar mirrors."""
        cache = self._cache if approximation == _EXACT else self._cache.transient
        patches, reflectances = direct_light.patches, light.reflectances
        reflectance_operator = cache.get_value(
            (self._key, "reflectance", reflectances), lambda: patches.reflectance_operator(reflectances)
        )
        incident = direct_light.incident_light(
            light, reflectance_operator, is_preview=not approximation.has_exact_lights
        )
        first, last = light.paths.first, light.paths.last
        if approximation.directions is Directions.NONE:
            key = self._key, "mean reflectance", reflectances
            mean = self._cache.transient.get_value(key, lambda: patches.mean_reflectance(reflectance_operator))
            return solve_isotropic(patches, reflectance_operator, incident, mean, first, last)
        outgoing_highlights = (
            _outgoing_highlights(
                light, reflectance_operator, direct_light, is_preview=not approximation.has_exact_lights
            )
            if approximation.has_sharp_highlights
            else None
        )
        return solve_bounces(
            patches, reflectance_operator, incident, first, last, outgoing_highlights, approximation.directions
        )


def _outgoing_highlights(
    light: Illumination,
    reflectance_operator: ReflectanceOperator,
    direct_light: DirectPatchLight,
    *,
    is_preview: bool,
) -> OutgoingHighlights:
    """Return the direct light reflected by sharp highlights."""
    highlights = direct_light.patches.highlight_tables(light.reflectances, reflectance_operator)
    return highlights, outgoing_in_highlights(
        direct_light.patches, highlights, direct_light.direct(light, highlights.rows, is_preview=is_preview)
    )


def _indirect_only(light: Illumination) -> Illumination:
    """Return the part of a light that the patches depend on."""
    return light._replace(paths=light.paths.without_direct())
