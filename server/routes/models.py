"""/api/models: every BRDF term, its parameters and curves; sliders are built from it. How moving views send terms."""

from __future__ import annotations

from fastapi import APIRouter
from fastapi.concurrency import run_in_threadpool

from relume.brdf import registry
from relume.brdf.document import complete_term
from relume.brdf.mirror import mirrors_below
from server.wire.bodies import InOutBody, InOutRequest, ModelBody

router = APIRouter(prefix="/api/models", tags=["models"])


@router.get("")
def list_models() -> list[ModelBody]:
    """Every BRDF term."""
    return [ModelBody(**term, mirrors_below=mirrors_below(term["model"])) for term in registry.describe()]


@router.post("/in-out")
async def show_in_out(request: InOutRequest) -> list[InOutBody]:
    """How terms are sent in views whose eye moves: the in-out factorisation of each (Mahajan 2008)."""
    terms = [complete_term(("terms", index), term, None) for index, term in enumerate(request.terms)]
    return await run_in_threadpool(_in_out, terms)


def _in_out(terms: list[dict[str, object]]) -> list[InOutBody]:
    from relume.moving.basis.in_out import in_out  # loads compiled kernels

    return [InOutBody(**in_out(term)._asdict()) for term in terms]
