"""Live sessions: what a client wants, what its picture shows, and what goes over the wire."""
