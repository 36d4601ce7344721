"""What is behind a picture, and how much of it is hidden."""
