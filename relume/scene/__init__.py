"""Scenes: meshes, materials, cameras, lights, and the folder that stores them.

Read first: `model`, `scene_folder`.
"""
