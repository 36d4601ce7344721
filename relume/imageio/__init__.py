"""Pictures as files: EXR keeps linear radiance, PNG and WebP hold what the screen shows."""
