"""Gather cells: what arrives at them, what they make of it, and what they send to each other."""
