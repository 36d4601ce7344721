"""Brute force from the command line."""
