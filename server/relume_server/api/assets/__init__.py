"""Routes of assets that looks name: materials, BTFs, environments, images."""
