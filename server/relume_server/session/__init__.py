"""Live sessions: requests of a client in, frames out."""
