"""Property tests: the same property with few random examples always, and with many of them in the slow tests."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any

import pytest
from hypothesis import Phase, given, settings
from hypothesis.strategies import SearchStrategy

_MANY = 25  # times as many examples in the slow tests


def for_all(
    num_examples: int, **strategies: SearchStrategy[Any]
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Decorate a test: it holds for all values of `strategies`; its other arguments are fixtures and parameters.

    Args:
        num_examples: of the quick run.
        strategies: by the name of the test's argument.
    """

    def decorate(test: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(test)
        def run(num_random_examples: int, **fixed: Any) -> None:
            # shrinking a failure takes minutes, and explaining it
            phases = [Phase.generate] if num_random_examples == num_examples else [Phase.generate, Phase.shrink]

            @settings(max_examples=num_random_examples, phases=phases)
            @given(**strategies)
            def holds(**drawn: Any) -> None:
                test(**fixed, **drawn)

            holds()

        signature = inspect.signature(test)
        names = ["num_random_examples", *(name for name in signature.parameters if name not in strategies)]
        kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
        run.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[inspect.Parameter(name, kind) for name in names]
        )
        many = pytest.param(_MANY * num_examples, marks=pytest.mark.slow, id="many")
        return pytest.mark.parametrize("num_random_examples", [pytest.param(num_examples, id="few"), many])(run)

    return decorate
