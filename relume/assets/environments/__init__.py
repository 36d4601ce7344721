"""Environment maps: built-in daylight and studios, and imported files.

Read first: `environment`, `environment_names`.
"""
