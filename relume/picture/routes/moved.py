"""Local lights that were moved: what they give straight to a picture, evaluated anew each frame.

Shadows are traced for the place where a light is now, for the whole view at once, and kept in passing. Terms that
scatter evenly need no more of a light than what arrives; others list its rays.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from relume.light.triangles import NO_LIGHTS
from relume.look import LightGeometry
from relume.operators.shade import Shaded, shaded_bytes, shaded_rows
from relume.parallel import for_shares
from relume.picture.jobs import Place, weighted_sum
from relume.picture.light import Light, Source, direct_from
from relume.picture.live_term import LiveTerm
from relume.picture.material_image import MaterialImage
from relume.picture.view_images import ViewImages
from relume.points import Points
from relume.project.contraction import contract
from relume.project.levels import contract_levels
from relume.project.receivers import LocalRays, Receivers, ThrownRays
from relume.trace.local_shadows import arriving
from relume.trace.preview_light import PreviewLight
from relume.views.compose import add_even

F32 = NDArray[np.float32]


class MovedLights:
    """Of the terms of one view."""

    def __init__(self, images: ViewImages) -> None:
        self._images = images
        self._place = images.transfer.key, images.view.name, images.view.maps

    def add_change(self, place: Place, before: Light, after: Light, out: F32) -> None:
        """Add what comes straight to a term's samples from lights that were not there before, and take off what came
        from those that are not there any more.

        Args:
            place: of the term. before: light of `out`. after: light that it is brought to.
            out: shaped like the term's image. (tiles, 3, samples) float32, written
        """
        if not after.paths.direct:
            return
        _, material, live = place
        gone = [source for source in before.local if source not in after.local]
        come = [source for source in after.local if source not in before.local]
        for source in gone:
            element = direct_from(before, (Source(source.geometry, (1.0, 1.0, 1.0)),))
            red, green, blue = source.gain
            weighted_sum(out, [(self._before(material, live, element), (-red, -green, -blue))])
        if come:
            self._add_now(material, live, come, out)

    def add_thrown(self, place: Place, rays: ThrownRays, out: F32) -> None:
        """Add what flat mirrors throw to a term's samples, the few that see any of it.

        Args:
            place, out: as of `add_change`. rays: to all samples of its material.
        """
        _, material, live = place
        lit = np.flatnonzero(rays.visible.any(axis=1))
        if len(lit):
            some = replace(self._images.unlit(material).places(lit), rays=[rays.alone(lit)])
            tile, offset = np.divmod(lit, out.shape[2])
            out[tile, :, offset] += self._rows(live, some, len(lit), None)

    def _before(self, material: MaterialImage, live: LiveTerm, light: Light) -> F32:
        """What comes straight from a light that stood still, as exact as in the picture that was shaded; the same in
        every frame, and so kept. Where a hand took its time it was made before (`Transition`)."""
        images = self._images
        key = images.key_of_image(material, live, light)

        def shaded() -> Shaded:
            rays, factor = self._exact_rays(material, light), _even_factor(live)
            if factor is None:
                return self._shaded(material, live, rays)
            found, points = np.zeros_like(live.ready.image), self._points().rows(images.view.rows(material.index))
            for of_light in rays:
                seen = arriving(of_light.light, of_light.strata, points, of_light.visible)
                add_even(seen, factor * of_light.gain, found)
            return Shaded(found)

        return images.cache.get(key, Shaded, shaded_bytes(material.num_samples), shaded).image

    def _exact_rays(self, material: MaterialImage, light: Light) -> list[LocalRays]:
        """Of a light that has local lights alone, as pictures at rest have them."""
        images = self._images
        _, points = images.transfer.arriving(images.view, material.index, light, images.cache)
        return [rays for rays in points.rays if isinstance(rays, LocalRays)]

    def _add_now(self, material: MaterialImage, live: LiveTerm, come: list[Source], out: F32) -> None:
        factor, rows = _even_factor(live), self._images.view.rows(material.index)
        lights = [(source, self._roughly(source.geometry)) for source in come]
        if factor is not None:
            for source, light in lights:
                add_even(light.arriving[rows], factor * source.gain, out)
            return
        local = self._images.transfer.local
        rays = [local.preview_rays(source, light.visible[rows]) for source, light in lights]
        out += self._shaded(material, live, rays, Shaded(out).rows(material.num_samples)).image

    def _roughly(self, geometry: LightGeometry) -> PreviewLight:
        transfer = self._images.transfer
        key = *self._place, "moved light", geometry
        return self._images.cache.passing.keep(key, lambda: transfer.local.preview(geometry, self._points()))

    def _shaded(
        self, material: MaterialImage, live: LiveTerm, rays: list[LocalRays], beside: F32 | None = None
    ) -> Shaded:
        """What rays bring a term, in the threads of frames. beside: what is shown already, see `Shader`"""
        points = replace(self._images.unlit(material), rays=rays)
        return Shaded.of(self._rows(live, points, material.num_samples, beside))

    @staticmethod
    def _rows(live: LiveTerm, points: Receivers, num_samples: int, beside: F32 | None) -> F32:
        contractions = contract_levels(live.term, live.target, None)
        rows = np.empty((num_samples, 3), np.float32)

        def add(start: int, stop: int) -> None:
            rows[start:stop] = shaded_rows(live.term, contractions, NO_LIGHTS, points, start, stop, beside)

        for_shares(add, len(rows))
        return rows

    def _points(self) -> Points:
        """Those of the view; of samples that are seen from behind the normals are nothing, and no light arrives."""
        view = self._images.view

        def read() -> Points:
            points = view.all_points()
            return points._replace(normal=points.normal * (view.cos_theta_o > 0)[:, None].astype(np.float32))

        return self._images.cache.keep((*self._place, "points"), read)


def _even_factor(live: LiveTerm) -> NDArray[np.float64] | None:
    """What a term makes of all light that arrives; None where it asks where that comes from. (3,)"""
    if not live.term.is_lambertian:
        return None
    contraction = contract(live.term, live.target, None)
    if contraction.kinds.size:
        return None
    upright = live.term.quotients(*np.array([0, 0, 1, 0, 0, 1], np.float32))
    return np.asarray(contraction.constant * upright, np.float64)
