"""Export of a scene with a look to files of other programs, each material as a principled surface."""
