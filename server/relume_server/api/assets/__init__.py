"""Routes of assets for looks: materials, BTFs, environments, images."""
