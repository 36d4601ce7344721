"""Archives from untrusted sources, with limits."""
