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
    for prim in list(Usd.PrimRange(stage.GetPseudoRoot(), Usd.PrimDefaultPredicate)):
        if not prim.IsA(UsdSkel.Root):
            continue
        try:
            is_baked = UsdSkel.BakeSkinning(UsdSkel.Root(prim), Gf.Interval(time.GetValue()))
        except Tf.ErrorException:
            is_baked = False
        if not is_baked:
            message = f"The skeleton of {quote(prim.GetName())} cannot be used; its meshes are in their bind pose."
            warnings.append(unsupported(message))
