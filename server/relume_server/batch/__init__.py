"""Batch steps, run in separate processes that yield to sessions."""
