"""OpenColorIO: views of a config as tone maps, its color spaces as primaries of exported images."""
