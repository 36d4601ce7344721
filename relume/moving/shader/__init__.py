"""The moving picture for a browser's shader: the sum of `relume.moving.frame`, its operands as arrays of texels."""
