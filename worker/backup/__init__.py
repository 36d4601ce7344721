"""Backups: what a data directory and its ledger hold at one moment, in a folder that grows by what is new."""
