"""Capacity beyond one machine: what one person and one bake cost, and a simulation of many of both."""
