"""Terms in the light before an edit: what other surfaces receive from the edited one follows when the drag ends.

An edit of a curve or a parameter changes the light that the edited surface reflects to all others, and so the light of
every image. During the drag each term shows its reference image, the edited one with its operator in the light of that
reference. Direct light is then exact, and indirect light is that of before.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import Illumination, equal_up_to_reflectances
from relume.live.fixed_camera.strategies import operator
from relume.live.fixed_camera.strategies.strategy import Strategy
from relume.live.fixed_camera.view_images import TermTarget


def _is_ready(target: TermTarget, light: Illumination) -> bool:
    images, material, live = target
    reference = live.ready.reference
    if reference is None or reference.light is None or not equal_up_to_reflectances(reference.light, light):
        return False
    changed = set(reference.changed_curves(live.target_bands))
    if not changed:
        return True
    steps = images.operator(material, live, reference)
    return steps is not None and reference.basis is not None and changed <= set(reference.basis.affected_curves)


def _update(target: TermTarget, light: Illumination, max_coefficients: int | None) -> None:
    images, material, live = target
    reference = live.ready.reference
    assert reference is not None
    steps = images.operator(material, live, reference)
    if steps is not None:
        reference = live.mark_lobe(operator.advance(reference, live.target_bands, steps, None))
    image = live.ready.image  # only the picture's own state refers to it
    np.copyto(image, reference.image)
    live.set_ready(
        replace(
            live.ready,
            fidelity=Fidelity.APPROXIMATE,
            bands=reference.bands,
            light=light,
            reference=reference,
            traces_lobe=reference.traces_lobe,
        )
    )


EARLIER_REFLECTANCES = Strategy(
    name="earlier reflectances",
    needs="the reference image; the operator of the edited term in its light",
    cost="a copy of each image, and a step of the edited one",
    fidelity=Fidelity.APPROXIMATE,
    changes_light=True,
    is_ready=_is_ready,
    update=_update,
)
