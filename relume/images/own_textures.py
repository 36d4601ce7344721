"""Textures of a bake's scene as images of a look, so that their texture coordinates can be transformed.

Their names are "image:own/<bake>/<texture>". Looks of users cannot have them: they name files of the library.
"""

from __future__ import annotations

from weakref import WeakValueDictionary

from relume.brdf.texture_slots import IMAGES
from relume.core.cache import get_asset
from relume.core.digest import digest
from relume.core.errors import NotFoundError
from relume.scene.model import WRAPS, Texture
from relume.store.bake_protocol import StoreReader

_PREFIX = f"{IMAGES.prefix}own/"


class OwnTextures:
    """The textures that a store has of its scene, loaded by name while this object exists.

    Args:
        key: of the bake. store: the bake's.
    """

    def __init__(self, key: str, store: StoreReader) -> None:
        self._prefix, self._store = f"{_PREFIX}{digest(key)[:16]}/", store

    @classmethod
    def of(cls, key: str, store: StoreReader) -> OwnTextures:
        """Return the textures of an open bake, the same object for all that open it."""
        own = cls(key, store)
        return _open.setdefault(own._prefix, own)

    def name(self, path: str) -> str:
        """Return the name of a texture. path: of its array in the store"""
        return self._prefix + path

    def load(self, path: str) -> Texture:
        """Load the texture at a path, in half precision."""

        def read() -> Texture:
            kind, index = path.split("/")
            u, v = self._store.attributes["wraps" if kind == "textures" else "roughness_wraps"][int(index)]
            return Texture(self._store.read(path), (WRAPS[u], WRAPS[v]))

        return get_asset("own texture", (self._prefix, path), read)


def is_own_texture(name: str) -> bool:
    """True if an image of a look is a texture of a bake's scene."""
    return name.startswith(_PREFIX)


def load_own_texture(name: str) -> Texture:
    """Load a texture of an open bake's scene.

    Raises:
        NotFoundError: its bake is not open.
    """
    bake, _, path = name.removeprefix(_PREFIX).partition("/")
    own = _open.get(f"{_PREFIX}{bake}/")
    if own is None:
        raise NotFoundError("the bake of a texture is not open")
    return own.load(path)


_open: WeakValueDictionary[str, OwnTextures] = WeakValueDictionary()
