"""How many coefficients a moving frame may spend, so that a step takes about as long as it should."""

from __future__ import annotations

TARGET_MS = 5.0
MIN_COEFFICIENTS, MAX_COEFFICIENTS = 8, 4096


class Pace:
    """Learns from each step; the picture says only how long it took and whether it is exact."""

    def __init__(self) -> None:
        self.max_coefficients = 32

    def learn(self, update_ms: float, exact: bool) -> None:
        """An inexact step spent its whole budget: scale it to the target. An exact one that was quick: allow more."""
        if not exact:
            factor = min(4.0, max(0.25, TARGET_MS / max(update_ms, 1e-3)))
            self.max_coefficients = int(self.max_coefficients * factor)
        elif update_ms < TARGET_MS:
            self.max_coefficients *= 2
        self.max_coefficients = min(MAX_COEFFICIENTS, max(MIN_COEFFICIENTS, self.max_coefficients))
