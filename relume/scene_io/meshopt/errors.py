"""Errors of the meshopt decoder."""


class MeshoptError(ValueError):
    """The data is truncated, too long, or invalid."""
