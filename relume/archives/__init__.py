"""Archives from outside, opened within bounds."""
