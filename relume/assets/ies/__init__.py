"""IES files: luminous intensity of luminaires over directions."""
