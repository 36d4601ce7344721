"""Skinned meshes in their pose at one time, with UsdSkel's own deformation."""

from __future__ import annotations

from typing import Any

from relume.core.import_warnings import ImporterWarning, quote, unsupported


def bake_skinning(stage: Any, time: Any, warnings: list[ImporterWarning]) -> None:
    """Replace the points of skinned meshes by deformed ones, in the session layer of a stage.

    A skeleton without an animation has its rest pose. Meshes within native instances stay in their bind pose.

    Args:
        stage: a UsdStage. time: a UsdTimeCode. warnings: gets a sentence for each skeleton that cannot be used.
    """
    from pxr import Gf, Tf, Usd, UsdSkel

    stage.SetEditTarget(stage.GetSessionLayer())
    prims = list(Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimDefaultPredicate))
    for prim in prims:
        if prim.IsA(UsdSkel.Animation):
            _add_sample(prim, time)
    for prim in prims:
        if not prim.IsA(UsdSkel.Root):
            continue
        try:
            is_baked = UsdSkel.BakeSkinning(UsdSkel.Root(prim), Gf.Interval(time.GetValue()))
        except Tf.ErrorException:
            is_baked = False
        if not is_baked:
            message = f"The skeleton of {quote(prim.GetName())} cannot be used; its meshes are in their bind pose."
            warnings.append(unsupported(message))


def _add_sample(animation: Any, time: Any) -> None:
    """Give an animation a sample at a time: UsdSkel bakes the times of samples alone."""
    for attribute in animation.GetAuthoredAttributes():
        if attribute.GetNumTimeSamples() and (value := attribute.Get(time)) is not None:
            attribute.Set(value, time)
