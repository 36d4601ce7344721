"""Backups of a data directory and its ledger: incremental, checked, restored."""
