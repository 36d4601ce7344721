"""What goes over the wire: bodies of REST calls, messages of sessions, each declared once."""
