"""Highlights between probes: lobe visibility, prefiltered environment, bright lights."""
