"""Logs: lines of text or JSON with request, session, bake and user."""
