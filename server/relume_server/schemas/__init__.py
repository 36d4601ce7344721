"""Bodies of REST calls and messages of sessions, each declared once."""
