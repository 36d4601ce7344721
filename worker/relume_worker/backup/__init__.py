"""Backups of a data directory and its database: incremental, verified, restorable."""
