"""Refinement when the camera stops: residual correction by exact samples, then an exact static view."""
