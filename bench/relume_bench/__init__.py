"""Benchmarks: each performance claim is a figure from here. Start at `registry`."""
