"""How many coefficients a moving frame may spend, so that a step takes about as long as it should."""

from __future__ import annotations

TARGET_MS = 4.0
MIN_COEFFICIENTS, MAX_COEFFICIENTS = 8, 512


class CoefficientBudget:
    """Learns from each step; the picture says only how long it took and whether it is exact."""

    def __init__(self) -> None:
        self.max_coefficients = 32

    def learn(self, update_ms: float, exact: bool) -> None:
        """Scale the budget to the target; a step that was exact and quick may not have spent it: allow more."""
        factor = min(4.0, max(0.25, TARGET_MS / max(update_ms, 1e-3)))
        if exact and factor > 1.0:
            factor = 2.0
        scaled = round(self.max_coefficients * factor)
        self.max_coefficients = min(MAX_COEFFICIENTS, max(MIN_COEFFICIENTS, scaled))
