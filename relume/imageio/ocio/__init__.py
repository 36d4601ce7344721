"""OpenColorIO: the views of a config as tone maps, its colour spaces as primaries of exported pictures."""
