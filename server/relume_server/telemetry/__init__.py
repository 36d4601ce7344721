"""Metrics, traces, and logs."""
