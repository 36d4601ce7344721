"""Backup commands: create, check, restore."""
