"""Display LUTs that users uploaded, "lut:<id>" in the display of looks. First: `read_cube`."""
