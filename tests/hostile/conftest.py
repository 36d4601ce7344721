"""The server's fixtures, for its hostile clients."""

from server_fixtures import baked, client, control, settings

__all__ = ["baked", "client", "control", "settings"]
