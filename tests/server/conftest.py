"""The fixtures of server tests."""

from server_fixtures import baked, client, control, settings

__all__ = ["baked", "client", "control", "settings"]
