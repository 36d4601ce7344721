"""One live picture whose eye moves, under a look that changes: evaluated whole for every frame."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from relume.brdf.registry import TERMS
from relume.errors import EditNotSupportedError, ParameterError
from relume.imageio.files import to_bytes
from relume.look import Look
from relume.moving.arriving import Arriving, LightJob, arriving, roughly
from relume.moving.basis.lobes import Lobes, lobes_of
from relume.moving.behind import Caught, alpha_of, lay_over, seen_behind
from relume.moving.bumps import towards_light
from relume.moving.edges import resolve
from relume.moving.evaluate import Tables, send, tables_of
from relume.moving.glints import glance
from relume.moving.look_up import Seen, at_vertices, look
from relume.moving.pixels import Mirrored, Sent, combine
from relume.moving.sky import Sky, turn_of
from relume.moving.transfer import MovingTransfer
from relume.picture.fidelity import Word
from relume.picture.light import Light, Solo, emission_of, gain_of, light_of, vector_of
from relume.picture.picture import Advance
from relume.picture.pointer import CurvePointer, ParameterPointer, parse_pointer
from relume.picture.view_images import documents_of
from relume.scene.model import Camera
from relume.views.resolve import encode_pixels

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]


class _Materials(NamedTuple):
    """What materials send: tables of what the in-basis tells, lobes of the rest."""

    tables: Tables
    lobes: Lobes

    @property
    def sends(self) -> NDArray[np.bool_]:
        """Whether a material sends anything of a group of terms. (materials, groups)"""
        sends = np.asarray((self.tables.of >= 0).any(axis=2))
        with_lobe = self.lobes.of >= 0
        sends[with_lobe] |= np.asarray(self.lobes.albedo.any(axis=(1, 3)))[self.lobes.of[with_lobe]]
        return sends


class MovingPicture:
    """State of one session's picture; used from one thread at a time.

    Args:
        is_watched: somebody looks at it while it changes, and sees a rough picture first where a better one takes long.
    """

    def __init__(self, transfer: MovingTransfer, view_name: str, *, is_watched: bool = False) -> None:
        view = transfer.views[view_name]
        self._transfer, self._camera, self._size = transfer, view.camera, (view.width, view.height)
        self._num_eyes = 0  # that it has been given: tells them apart
        self._look: Look | None = None
        self._light: Light | None = None
        self._solo: Solo = None
        self._is_watched = is_watched
        self._is_rough = False  # what is shown was found quickly
        self._shown: tuple[Any, ...] | None = None
        self._image = np.zeros((view.height, view.width, 3), np.float32)
        self._hides: F32 | None = None  # how much of what is behind it, where the background is transparent
        self._seen: tuple[int, Seen] | None = None
        self._materials: tuple[Any, _Materials] | None = None
        self._vectors: tuple[Light, Arriving] | None = None

    def check(self, look: Look) -> None:
        """Whether a look can be shown at all: what its terms send is found in tables, of any number of terms."""

    def set_look(self, look: Look, *, hand: str | None = None, solo: Solo = None) -> None:
        """A new target; nothing is computed yet.

        Args:
            look: that is to be shown. hand: pointer to what the user's hand is on, or None.
            solo: names of sources of light that alone are shown, see `light_of`; None: all.
        Raises:
            ParameterError: `hand` points to nothing that a hand may hold. NotFoundError, SceneError: the environment
                cannot be had. The picture stays as it was.
        """
        if hand is not None:
            parse_pointer(hand)
        light = light_of(look, self._transfer.material_names, has_bounces=True, solo=solo)
        self._transfer.map_of(light.environment.map)  # what cannot be had is said now
        self._look, self._light, self._solo = look, light, solo

    def set_eye(self, camera: Camera, size: tuple[int, int]) -> None:
        """See from elsewhere, in a picture of another size; nothing is computed yet.

        Args:
            camera: a rigid one. size: width and height in pixels.
        """
        self._camera, self._size = camera, size
        self._num_eyes += 1

    @property
    def eye(self) -> tuple[Camera, tuple[int, int]]:
        """Where it is seen from, and the size of the picture."""
        return self._camera, self._size

    def touch(self, pointer: str) -> None:
        """Take note of what a hand holds; nothing needs to be prepared.

        Raises:
            ParameterError: there is no such thing.
        """
        found = parse_pointer(pointer)
        if isinstance(found, CurvePointer | ParameterPointer) and self._look is not None:
            self._check_there(found, self._look)

    @staticmethod
    def _check_there(pointer: CurvePointer | ParameterPointer, shown: Look) -> None:
        material = shown.materials.get(pointer.material)
        if material is None or not 0 <= pointer.term < len(material.terms):
            raise ParameterError("pointer", str(pointer), "a term of this look")
        declared = TERMS[material.terms[pointer.term]["model"]]
        names = declared.curves if isinstance(pointer, CurvePointer) else declared.parameters
        if pointer.name not in [one.name for one in names]:
            raise ParameterError("pointer", str(pointer), "a curve or a parameter of its term")

    def next_job(self) -> LightJob | None:
        """What makes a rough picture as good as it gets: the light vectors that it lacks."""
        is_waiting = self._is_rough and self._has_to_be_rough()
        return LightJob(self._transfer, self._now(), self.take) if is_waiting else None

    def install(self, job: Any, made: Any) -> None:
        """Go on with what a job has made."""
        job.install(made)

    def take(self, light: Light, vectors: Arriving) -> None:
        """Go on with the light vectors of a light, unless it is another one by now."""
        if light == self._now():
            self._vectors = light, vectors

    def advance(self, max_coefficients: int | None) -> Advance:
        """Bring the picture to its look and its eye."""
        wanted = (self._look, self._solo, self._num_eyes)
        if self._look is None or (wanted == self._shown and self._is_rough == self._has_to_be_rough()):
            return Advance([], exact=False, fidelity=self._fidelity, complete=True)
        self._is_rough = self._has_to_be_rough()
        self._image = self._evaluate(self._look)
        self._shown = wanted
        return Advance(self.all_tiles(), exact=False, fidelity=self._fidelity, complete=True)

    @property
    def _fidelity(self) -> Word:
        return "preview" if self._is_rough else "approximate"

    def _has_to_be_rough(self) -> bool:
        """Whether somebody would wait for light vectors that nobody has."""
        light = self._now()
        has_them = self._vectors is not None and self._vectors[0] == light
        return self._is_watched and not has_them and not all(map(self._transfer.knows, vector_of(light)))

    def _evaluate(self, shown: Look) -> F32:
        """The picture, (height, width, 3) float32."""
        transfer, camera = self._transfer, self._camera
        width, height = self._size
        seen = self._look_around()
        eye = camera.to_world[:3, 3].astype(np.float32)
        materials = self._materials_of(shown)
        light = self._vectors_now(seen)
        broad = send(transfer.surface, light.total, materials.tables, eye, seen.is_needed)
        glances = glance(transfer.surface, transfer.sky_share, light.others, materials.lobes, eye, seen.is_needed)
        mirrored = Mirrored(materials.lobes, *self._sky_now(), at_vertices(transfer.surface, seen.is_seen, glances))
        broad = at_vertices(transfer.surface, seen.is_seen, broad)
        sent = Sent(broad, materials.sends, self._towards_light(light, seen))
        emission = np.array([emission_of(self._now(), name) for name in transfer.material_names], np.float32)
        pixel_angle = camera.yfov / height
        out = combine(transfer.surface, seen, pixel_angle, sent, emission, mirrored)
        gain = np.array(gain_of(shown, self._solo), np.float32)
        out *= gain
        caught = self._caught(shown, seen)
        behind = seen_behind(transfer, shown.background, self._now(), gain, seen, caught.is_catcher)
        is_direct = self._now().paths.direct
        hides = lay_over(transfer.surface, seen, behind, caught, gain, is_direct=is_direct, out=out)
        is_transparent, num = shown.background.kind == "transparent", width * height
        self._hides = resolve(hides, seen.owner, num).reshape(height, width) if is_transparent else None
        return resolve(out, seen.owner, num).reshape(height, width, 3)

    def _caught(self, shown: Look, seen: Seen) -> Caught:
        """What would arrive at catchers if nothing were in the way."""
        transfer, light = self._transfer, self._now()
        is_catcher = np.array([shown.materials[name].catcher for name in transfer.material_names])
        if not is_catcher.any():
            return Caught(is_catcher, np.empty((0, 3), np.float32))
        of_points = np.zeros((transfer.surface.points.num_points, 3), np.float32)
        for material in np.flatnonzero(is_catcher):
            of_points += transfer.unhidden(light, int(material), is_preview=self._is_rough)
        return Caught(is_catcher, at_vertices(transfer.surface, seen.is_seen, of_points))

    def _towards_light(self, light: Arriving, seen: Seen) -> F32:
        """Where the light of vertices comes from, which matters under normal maps alone. (vertices or 0, 3)"""
        surface = self._transfer.surface
        if not len(surface.tangents):
            return np.empty((0, 3), np.float32)
        return at_vertices(surface, seen.is_seen, towards_light(surface, light.total, seen.is_needed))

    def _now(self) -> Light:
        assert self._light is not None
        return self._light

    def _look_around(self) -> Seen:
        if self._seen is None or self._seen[0] != self._num_eyes:
            transfer = self._transfer
            found = look(transfer.surface, transfer.embree, self._camera, self._size)
            self._seen = self._num_eyes, found
        return self._seen[1]

    def _materials_of(self, shown: Look) -> _Materials:
        terms = [[dict(term) for term in documents_of(shown, name)] for name in self._transfer.material_names]
        if self._materials is None or self._materials[0] != terms:
            self._materials = terms, _Materials(tables_of(terms), lobes_of(terms))
        return self._materials[1]

    def _sky_now(self) -> tuple[Sky, np.float32, F32]:
        """What lobes see where nothing hides it: the sky, its turn, its gain; none where no light comes straight."""
        light = self._now()
        is_seen = light.paths.direct and light.is_environment_lit
        gain = np.array(light.environment_gain if is_seen else (0.0, 0.0, 0.0), np.float32)
        return self._transfer.sky_in(light.environment.map), turn_of(light.environment.rotation), gain

    def _vectors_now(self, seen: Seen) -> Arriving:
        """Light vectors in the light of the look; where they may be rough, of what is seen alone."""
        light, transfer = self._now(), self._transfer
        if self._is_rough:
            return roughly(transfer, light, np.flatnonzero(seen.is_needed))
        if self._vectors is None or self._vectors[0] != light:
            self._vectors = light, arriving(transfer, light, transfer.vectors)
        return self._vectors[1]

    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the picture: one, for all of it changes together."""
        return [(0, 0, *self._size)]

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Payload of a frame: the tiles one after another, row-major."""
        parts = [self._image[y : y + height, x : x + width].reshape(-1, 3) for x, y, width, height in tiles]
        return encode_pixels(np.ascontiguousarray(np.concatenate(parts)), form)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """How much each pixel of tiles hides of display values behind it; see `Picture.encode_alpha`."""
        alpha = self.alpha(for_display=True)
        if alpha is None:
            return None
        return b"".join(to_bytes(alpha[y : y + height, x : x + width]).tobytes() for x, y, width, height in tiles)

    def alpha(self, *, for_display: bool) -> F32 | None:
        """The same of the whole picture, or of linear radiance; None where it hides all. (height, width) float32"""
        return None if self._hides is None else alpha_of(self._hides, for_display=for_display)

    def image(self) -> F32:
        """Linear radiance. (height, width, 3) float32"""
        return self._image

    def probe(self, x: int, y: int) -> dict[str, Any]:
        """What a pixel shows, and where its surface is.

        Raises:
            ParameterError: it lies outside the picture.
        """
        height, width, _ = self._image.shape
        if not (0 <= x < width and 0 <= y < height):
            raise ParameterError("pixel", [x, y], f"x below {width} and y below {height}")
        found: dict[str, Any] = {"material": None, "position": None, "normal": None, "bands": None, "curve": None}
        found["radiance"] = self._image[y, x]
        if self._seen is None or self._seen[1].hits.face[y * width + x] < 0:
            return found
        seen, pixel, surface = self._seen[1], y * width + x, self._transfer.surface
        face = int(seen.hits.face[pixel])
        place = self._camera.to_world[:3, 3] + float(seen.hits.distance[pixel]) * seen.directions[pixel]
        normal = seen.weight[pixel] @ surface.vertices.normal[seen.vertex[pixel]]
        return found | {
            "material": self._transfer.material_names[int(surface.face_material[face])],
            "position": place,
            "normal": normal / max(float(np.linalg.norm(normal)), 1e-12),
        }

    def brush(self, pointer: str, from_deg: float, to_deg: float) -> F32:
        """Refuse: no curve is frozen in pictures whose eye moves.

        Args:
            pointer: to a curve. from_deg, to_deg: ends of a stretch of it, degrees.

        Raises:
            EditNotSupportedError: always.
        """
        raise EditNotSupportedError(
            self._transfer.method, "a brush over a curve; open a fixed view of the scene for it"
        )
