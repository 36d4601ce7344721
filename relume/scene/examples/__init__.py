"""Example scenes, made by code."""
