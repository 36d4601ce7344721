"""Images of a free camera: light at surface probes in the Zernike basis (Sun et al. 2007, Mahajan et al. 2008).

Read first: `free_camera_picture`, `frame`, `shade_probes`.
"""
