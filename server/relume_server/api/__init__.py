"""REST routes, one resource per module."""
