"""Opened bakes of fixed cameras: transfer for images from the arrays of a store."""
