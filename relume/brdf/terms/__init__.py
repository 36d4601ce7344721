"""The BRDF models, one term each; `relume.brdf.registry` lists them."""
