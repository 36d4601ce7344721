"""Light of surface patches: incident light, reflectance operators, outgoing radiance, bounces.

Read first: `reflectance_operator`, `solve_bounces`.
"""
