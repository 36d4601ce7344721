"""Terminal output: results and progress."""
