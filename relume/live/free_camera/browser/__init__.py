"""The free-camera image for a browser's shader: the sum of `relume.live.free_camera.frame` as arrays of texels."""
