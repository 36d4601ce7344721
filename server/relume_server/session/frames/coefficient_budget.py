"""Number of coefficients per interactive step that meets the target time."""

from __future__ import annotations

TARGET_MS = 4.0
MIN_COEFFICIENTS, MAX_COEFFICIENTS = 8, 512


class CoefficientBudget:
    """Adapts after each step, from its time and whether the image is exact."""

    def __init__(self) -> None:
        self.max_coefficients = 32

    def learn(self, update_ms: float, exact: bool) -> None:
        """Scale the budget toward the target time; a fast exact step may not have used all of it, so it grows."""
        factor = min(4.0, max(0.25, TARGET_MS / max(update_ms, 1e-3)))
        if exact and factor > 1.0:
            factor = 2.0
        scaled = round(self.max_coefficients * factor)
        self.max_coefficients = min(MAX_COEFFICIENTS, max(MIN_COEFFICIENTS, scaled))
