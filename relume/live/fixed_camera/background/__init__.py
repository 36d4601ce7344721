"""Background compositing: the environment behind the image, shadow catchers, alpha."""
