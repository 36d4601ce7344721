"""Jobs that take minutes and survive restarts: renders, comparisons, BTFs."""
