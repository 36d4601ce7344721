"""Material previews: balls shaded in a fixed light, and the sheet of the library."""
