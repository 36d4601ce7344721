"""One route group per file."""
