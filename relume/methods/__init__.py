"""Transfer methods `direct`, `gather` and `probes`: what is planned and stored; nothing of pictures.

Read first: `relume.store.bake_protocol`, then `direct`.
"""
