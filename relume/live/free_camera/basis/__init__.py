"""BRDFs in the hemispherical basis: outgoing coefficients, narrow lobes (Mahajan et al. 2008, section 4)."""
