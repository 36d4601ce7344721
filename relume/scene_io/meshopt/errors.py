"""What is wrong with packed data."""


class MeshoptError(ValueError):
    """The data ends early, goes on too long, or is not of this kind."""
