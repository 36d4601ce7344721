"""Pictures whose eye moves: light kept at points of the surfaces, and summed with what materials send to the eye."""
