"""Uploads, imports in sandboxed processes, downloads, thumbnails, video."""
