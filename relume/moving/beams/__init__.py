"""Beams: light of suns and small lamps, whose shadows pixels find by themselves."""
