"""Fixtures of the server tests."""

from server_fixtures import ack_seconds, baked, client, control, empty_ledger, settings

__all__ = ["ack_seconds", "baked", "client", "control", "empty_ledger", "settings"]
