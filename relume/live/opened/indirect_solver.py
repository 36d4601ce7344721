"""Outgoing radiance of a bake's patches under the lights of its images, computed once for all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination, Normals, equal_up_to_reflectances
from relume.live.opened.patch_direct_light import DirectPatchLight
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.highlight_transport import outgoing_in_highlights
from relume.radiosity.outgoing_radiance import OutgoingHighlights, OutgoingRadiance
from relume.radiosity.reflectance_operator import ReflectanceOperator
from relume.radiosity.solve_bounces import solve_indirect, solve_indirect_fast, solve_indirect_preview
from relume.transport.outgoing_patch_light import OutgoingLight, isotropic

F32 = NDArray[np.float32]


class IndirectSolver:
    """Indirect illumination from patches; thread-safe.

    Incremental updates use the baked normals, for both ends of an edit alike.

    Args:
        direct_light: direct illumination of the patches.
        find_direct_light: returns the same for normal-map overrides, by the image of each material.
        key: key of the bake in `cache`.
    """

    def __init__(
        self,
        direct_light: DirectPatchLight,
        find_direct_light: Callable[[Normals], DirectPatchLight],
        cache: Cache,
        key: str,
    ) -> None:
        self._direct_light, self._find_direct_light, self._patches = (
            direct_light,
            find_direct_light,
            direct_light.patches,
        )
        self.num_patches = self._patches.num_patches
        self._cache, self._key = cache, key

    def exact(self, light: Illumination) -> OutgoingLight:
        """Return the outgoing light for exact images."""
        indirect = _without_direct(light)
        return self._cache.get_value((self._key, "indirect light", indirect), lambda: self._outgoing_light(indirect))

    def excluding(self, light: Illumination, excluded: Callable[[Illumination], OutgoingRadiance]) -> OutgoingLight:
        """Return exact light without the part that `excluded` returns, which is displayed by other means."""
        indirect = _without_direct(light)

        def compute() -> OutgoingLight:
            return (
                self._outgoing(indirect)
                .subtract(excluded(indirect))
                .outgoing_light(self._direct_light_for(indirect).patches)
            )

        return self._cache.get_value((self._key, "indirect light without mirror lights", indirect), compute)

    def preview(self, light: Illumination) -> Shaped[F32, "patches 3"]:
        """Return isotropic light for incremental updates of an active edit; never waits for exact light."""
        indirect = _without_direct(light)
        key = self._key, "indirect light, preview", indirect
        return self._cache.transient.get_value(key, lambda: self._preview(indirect))

    def fast(self, light: Illumination) -> OutgoingLight:
        """Return approximate light for free-camera images during an edit of a light."""
        return self._fast(_without_direct(light), is_preview=True).outgoing_light(self._patches)

    def preview_delta(self, before: Illumination, after: Illumination) -> Shaped[F32, "patches 3"]:
        """Return the change of isotropic radiance; both ends are approximated alike, so that errors cancel.

        If only materials have changed, light between patches keeps its directions through highlights, and the result is
        averaged over directions at the end.
        """
        if equal_up_to_reflectances(before, after):
            return self._delta(before, after).mean_to_others(self._patches)
        change = self.preview(after) - self.preview(before)
        return change[: self.num_patches]

    def delta(self, before: Illumination, after: Illumination) -> OutgoingLight:
        """Approximate the change of outgoing light for unchanged lights with exact direct illumination.

        Both ends are approximated alike, so that errors cancel.

        Args:
            before, after: light of the same sources.
        """
        return self._delta(before, after, is_sharp=True).outgoing_light(self._patches)

    def _delta(self, before: Illumination, after: Illumination, *, is_sharp: bool = False) -> OutgoingRadiance:
        outgoing_before, outgoing_after = (
            self._fast(_without_direct(light), is_preview=False, is_sharp=is_sharp) for light in (before, after)
        )
        return outgoing_after.subtract(outgoing_before)

    def _fast(self, light: Illumination, *, is_preview: bool, is_sharp: bool = False) -> OutgoingRadiance:
        """Return outgoing radiance. is_preview: approximates lights. is_sharp: sharp highlights use tables."""

        def compute() -> OutgoingRadiance:
            reflectance_operator = self._reflectance_operator(light, self._cache.transient)
            incident = self._direct_light.incident_light(light, reflectance_operator, is_preview=is_preview)
            outgoing_highlights = (
                self._outgoing_highlights(light, reflectance_operator, self._direct_light) if is_sharp else None
            )
            return solve_indirect_fast(
                self._patches, reflectance_operator, incident, light.paths.first, light.paths.last, outgoing_highlights
            )

        key = self._key, "indirect light, fast", light, is_preview, is_sharp
        return self._cache.transient.get_value(key, compute)

    def _outgoing_light(self, light: Illumination) -> OutgoingLight:
        if not light.paths.has_indirect:
            return isotropic(np.zeros((NO_PATCH + 1, 3), np.float32))
        return self._outgoing(light).outgoing_light(self._direct_light_for(light).patches)

    def _direct_light_for(self, light: Illumination) -> DirectPatchLight:
        """Return the direct light of patches with the look's normal maps."""
        return self._find_direct_light(light.normals) if any(light.normals) else self._direct_light

    def _outgoing(self, light: Illumination) -> OutgoingRadiance:
        reflectance_operator, direct_light = (
            self._reflectance_operator(light, self._cache),
            self._direct_light_for(light),
        )
        incident = direct_light.incident_light(light, reflectance_operator, is_preview=False)
        outgoing_highlights = self._outgoing_highlights(light, reflectance_operator, direct_light)
        return solve_indirect(
            direct_light.patches,
            reflectance_operator,
            incident,
            light.paths.first,
            light.paths.last,
            outgoing_highlights,
        )

    @staticmethod
    def _outgoing_highlights(
        light: Illumination, reflectance_operator: ReflectanceOperator, direct_light: DirectPatchLight
    ) -> OutgoingHighlights:
        """Return the direct light reflected by sharp highlights."""
        highlights = direct_light.patches.highlight_tables(light.reflectances, reflectance_operator)
        return highlights, outgoing_in_highlights(
            direct_light.patches, highlights, direct_light.direct(light, highlights.rows)
        )

    def _preview(self, light: Illumination) -> F32:
        if not light.paths.has_indirect:
            return np.zeros((NO_PATCH + 1, 3), np.float32)
        reflectance_operator = self._reflectance_operator(light, self._cache.transient)
        incident = self._direct_light.incident_light(light, reflectance_operator, is_preview=True)
        return solve_indirect_preview(
            self._patches, reflectance_operator, incident, light.paths.first, light.paths.last
        )

    def _reflectance_operator(self, light: Illumination, cache: Cache) -> ReflectanceOperator:
        key, reflectances = (self._key, "reflectance", light.reflectances), light.reflectances
        return cache.get_value(key, lambda: self._patches.reflectance_operator(reflectances))


def _without_direct(light: Illumination) -> Illumination:
    """Return the part of a light that the patches depend on."""
    return light._replace(paths=light.paths.without_direct())
