"""What the gather cells of a bake send out under the lights of its pictures, computed once for all of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from relume.core.cache import Cache
from relume.live.fixed_camera.illumination import Illumination, Normals, equal_up_to_reflectances
from relume.methods.patch_direct_light import DirectPatchLight
from relume.patches.patch_kdtree import NO_PATCH
from relume.radiosity.highlight_transport import outgoing_in_highlights
from relume.radiosity.outgoing_radiance import OutgoingHighlights, OutgoingRadiance
from relume.radiosity.reflectance_operator import ReflectanceOperator
from relume.radiosity.solve_bounces import solve_indirect, solve_indirect_fast, solve_indirect_preview
from relume.transport.outgoing_patch_light import OutgoingLight, isotropic

F32 = NDArray[np.float32]


class IndirectSolver:
    """Light that cells send; safe to use from several threads.

    What follows a hand is of the normals that were baked: it is made of both ends of an edit alike.

    Args:
        direct_light: what comes to them from the lights themselves.
        find_direct_light: finds the same where images lean materials, by the image of each.
        key: of the bake in `cache`.
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
        """What exact pictures show."""
        indirect = _without_direct(light)
        return self._cache.get_value((self._key, "indirect light", indirect), lambda: self._outgoing_light(indirect))

    def excluding(self, light: Illumination, excluded: Callable[[Illumination], OutgoingRadiance]) -> OutgoingLight:
        """The same without what `excluded` finds of it: what is shown of that is found otherwise."""
        indirect = _without_direct(light)

        def compute() -> OutgoingLight:
            return (
                self._outgoing(indirect)
                .subtract(excluded(indirect))
                .outgoing_light(self._direct_light_for(indirect).patches)
            )

        return self._cache.get_value((self._key, "indirect light without mirror lights", indirect), compute)

    def preview(self, light: Illumination) -> F32:
        """What pictures follow while a hand moves, the same in every direction; waits for nobody who wants something
        exact. (NO_CELL + 1, 3) float32"""
        indirect = _without_direct(light)
        key = self._key, "indirect light, preview", indirect
        return self._cache.transient.get_value(key, lambda: self._preview(indirect))

    def fast(self, light: Illumination) -> OutgoingLight:
        """What moving pictures follow while a hand moves a light."""
        return self._fast(_without_direct(light), is_preview=True).outgoing_light(self._patches)

    def preview_delta(self, before: Illumination, after: Illumination) -> F32:
        """How much more cells send, the same in every direction; both ends alike, so that what is wrong with both
        cancels. Where surfaces alone have changed, highlights give light directions on its way between cells, and
        what others see of each in the mean is what is left of them in the end. (C, 3) float32"""
        if equal_up_to_reflectances(before, after):
            return self._delta(before, after).mean_to_others(self._patches)
        change = self.preview(after) - self.preview(before)
        return change[: self.num_patches]

    def delta(self, before: Illumination, after: Illumination) -> OutgoingLight:
        """How what cells send changes, found quickly, where the lights themselves are as before and their light on
        cells is found exactly; both ends alike, so that what is wrong with both cancels.

        Args:
            before, after: of equal sources.
        """
        return self._delta(before, after, is_sharp=True).outgoing_light(self._patches)

    def _delta(self, before: Illumination, after: Illumination, *, is_sharp: bool = False) -> OutgoingRadiance:
        outgoing_before, outgoing_after = (
            self._fast(_without_direct(light), is_preview=False, is_sharp=is_sharp) for light in (before, after)
        )
        return outgoing_after.subtract(outgoing_before)

    def _fast(self, light: Illumination, *, is_preview: bool, is_sharp: bool = False) -> OutgoingRadiance:
        """What cells send. is_preview: lights are found quickly. is_sharp: sharp highlights go by tables."""

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
        """What comes to cells, which lean as the look says."""
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
        """What sharp highlights send of light that comes straight to them."""
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
    """All of a light that cells depend on."""
    return light._replace(paths=light.paths.without_direct())
