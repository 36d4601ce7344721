"""One live picture whose eye moves, under a look that changes: evaluated whole for every frame."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.errors import NotMadeError, ParameterError
from relume.look import Look
from relume.moving.again import Shown, shown_of
from relume.moving.beams.beam import Beam
from relume.moving.beams.shadows import shares_seen
from relume.moving.behind import alpha_of
from relume.moving.correction import corrected
from relume.moving.drawn import Drawn
from relume.moving.fine_job import FineJob, fine_frame
from relume.moving.frame import Frame, Materials, Wanted, change, frame_of, only_materials_differ, shows_texels
from relume.moving.look_up import Seen, look
from relume.moving.parted import mend
from relume.moving.points.surface import Surface
from relume.moving.relief.job import TablesJob
from relume.moving.relief.light import ReliefLight
from relume.moving.shader.tables import Numbers, Part, numbers_of, parts_of
from relume.moving.transfer import MovingTransfer
from relume.moving.vectors.arriving import Arriving
from relume.moving.vectors.jobs import FollowJob, LightJob
from relume.moving.vectors.live import Asked, LiveVectors
from relume.picture.fidelity import Word
from relume.picture.light import Light, Solo, gain_of, light_of
from relume.picture.picture import Advance
from relume.picture.pointer import CurvePointer, ParameterPointer, check_there, parse_pointer
from relume.picture.view_images import documents_of
from relume.scene.model import Camera
from relume.views.resolve import encode_coverage, encode_pixels

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]


class MovingPicture:
    """State of one session's picture; used from one thread at a time.

    Args:
        is_watched: somebody looks at it while it changes, and sees a rough picture first where a better one takes long,
            and its highlights finely only once eye and light rest.

    Attributes:
        draws: its pixels are wanted at every step; else a shader elsewhere finds them from `parts`, and they are drawn
            when somebody asks.
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
        self._drawn: Drawn | None = None
        self._part: tuple[Seen, bytes, Shown] | None = None
        self._seen: tuple[int, Seen] | None = None
        self._materials: tuple[Look | None, Materials | None] = None, None
        self._vectors, self._everywhere = LiveVectors(transfer), np.ones(transfer.vectors_shape[0], np.uint8)
        self._shares: tuple[int, dict[Hashable, F32]] = 0, {}  # of beams that an eye sees
        self._is_stale = False  # the frame is not of what is shown: nobody has asked for its pixels
        self._relief = ReliefLight()
        self._by: F32 | None = None  # what is added to the frame
        self._is_corrected = False  # what is shown has it
        self._is_finer = False  # than it was when somebody saw it
        self.draws = True
        self._told: Arriving | None = None
        self._num_told = self._num_materials = 0

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
        self._by = None

    def set_eye(self, camera: Camera, size: tuple[int, int]) -> None:
        """See from elsewhere, in a picture of another size; nothing is computed yet.

        Args:
            camera: a rigid one. size: width and height in pixels.
        """
        self._camera, self._size = camera, size
        self._num_eyes += 1
        self._by = None

    def correct(self, by: F32 | None) -> None:
        """Add what it is off by, see `relume.moving.correction`, until another look or eye is given.

        Args:
            by: of each pixel, (height, width, 3) float32; None: nothing.
        """
        self._by = by

    @property
    def is_corrected(self) -> bool:
        """Whether something is added that only this picture knows, no shader elsewhere."""
        return self._by is not None

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
            check_there(found, self._look)

    def next_job(self) -> FollowJob | LightJob | TablesJob | FineJob | None:
        """What makes a rough picture as good as it gets: the light vectors that it lacks; BTFs; then its highlights."""
        if self._is_rough and self._has_to_be_rough():
            return self._vectors.next_job(self._asked(), self._needed)
        if self._look is not None and (missing := self._materials_of(self._look).covers.missing):
            return TablesJob(missing[0].data, missing[0].components, self._show_texels)
        return self._fine_job() if self._is_watched and self.draws else None

    def _show_texels(self) -> None:
        """Show texels whose tables are there by now."""
        self._materials, self._shown = (None, self._materials[1]), None

    def _fine_job(self) -> FineJob | None:
        """Find highlights finely in what is shown, if they were not."""
        drawn = self._drawn
        if drawn is None or drawn.has_rims or self._is_stale or self._is_rough or self._to_show != self._shown:
            return None
        # made beside frames, which go on with the relief that they have
        finely = drawn.wanted._replace(is_fine=True, relief=ReliefLight())
        of = self._transfer, finely, drawn.seen, self._camera, self._size, drawn.shares

        def take(frame: Frame) -> None:
            if self._drawn is drawn and not self._is_stale and not drawn.has_rims:
                self._drawn = Drawn(finely, drawn.seen, frame, drawn.shares, has_rims=True)
                self._is_finer = True

        return FineJob(partial(fine_frame, *of), ("finer", self._num_eyes, id(drawn.wanted)), take)

    @property
    def _to_show(self) -> tuple[Any, ...]:
        """What has been asked for; equal to `_shown` where that is shown."""
        return self._look, self._solo, self._num_eyes, self._vectors.version

    def install(self, job: Any, made: Any) -> None:
        """Go on with what a job has made."""
        job.install(made)

    def advance(self, max_coefficients: int | None) -> Advance:
        """Bring the picture to its look and its eye."""
        wanted = self._to_show
        is_drawn = wanted == self._shown and self._is_rough == self._has_to_be_rough()
        if self._look is None or (is_drawn and self._is_corrected == self.is_corrected and not self._is_finer):
            return Advance([], exact=False, fidelity=self._fidelity, complete=True)
        self._is_corrected, self._is_finer = self.is_corrected, False
        if not is_drawn:
            self._is_rough = self._has_to_be_rough()
            self._is_stale, self._shown = True, wanted
        if self.draws:
            self._draw()
        return Advance(self.all_tiles(), exact=False, fidelity=self._fidelity, complete=True)

    @property
    def _fidelity(self) -> Word:
        return "preview" if self._is_rough else "approximate"

    def _has_to_be_rough(self) -> bool:
        """Whether somebody would wait for light vectors that nobody has."""
        return self._is_watched and not self._vectors.are_there(self._asked())

    def _asked(self) -> Asked:
        """What is to arrive; pixels find no shadows of beams where a shader draws, nor on BTFs."""
        assert self._look is not None
        return Asked(self._now(), self.draws and not any(self._materials_of(self._look).covers))

    @property
    def _needed(self) -> NDArray[np.uint8]:
        """Points whose light is asked about: those that the eye sees, or all where a shader draws from anywhere."""
        return self._look_around().is_needed if self.draws else self._everywhere

    def _draw(self) -> Drawn | None:
        """What is shown, evaluated where that has not been done; None before there is a look."""
        if not self._is_stale or self._look is None:
            return self._drawn
        seen, drawn = self._look_around(), self._drawn
        wanted = self._wanted(self._look, self._vectors_now(seen.is_needed))
        self._is_stale, shares = False, self._shares_of(wanted.arriving.beams, seen)
        if drawn is not None and self._may_change(drawn, wanted, seen):
            wanted = wanted._replace(is_fine=drawn.wanted.is_fine)
            shown = self._shown_of(drawn.wanted.materials, wanted.materials, seen)
            change(self._transfer, wanted, seen, self._camera, drawn.frame, shown, drawn.packed(), shares)
            drawn.wanted, drawn.has_rims = wanted, False
        else:
            find = fine_frame if wanted.is_fine else frame_of
            frame = find(self._transfer, wanted, seen, self._camera, self._size, shares)
            self._drawn = Drawn(wanted, seen, frame, shares, has_rims=wanted.is_fine)
        return self._drawn

    def _may_change(self, drawn: Drawn, wanted: Wanted, seen: Seen) -> bool:
        """Whether what was drawn may be changed; where nobody waits for it, all rims are found anew."""
        is_same = drawn.seen is seen and not len(seen.panes.ray) and only_materials_differ(drawn.wanted, wanted)
        if not (is_same and self._is_watched):
            return False
        shown = self._shown_of(drawn.wanted.materials, wanted.materials, seen)
        return not shows_texels(self._transfer, wanted.materials, seen, shown.part)

    def _shown_of(self, before: Materials, after: Materials, seen: Seen) -> Shown:
        """What shows materials that were edited; found once while a hand is on them."""
        is_changed = np.array([one is not other for one, other in zip(before.each, after.each, strict=True)])
        key = is_changed.tobytes()
        if self._part is None or self._part[0] is not seen or self._part[1] != key:
            num_pixels = self._size[0] * self._size[1]
            self._part = seen, key, shown_of(self._transfer.surface, seen, is_changed, num_pixels)
        return self._part[2]

    def _shares_of(self, beams: Sequence[Beam], seen: Seen) -> list[F32]:
        """What the rays of the eye see of each beam, found again where the eye or the beam has moved."""
        known = self._shares[1] if self._shares[0] == self._num_eyes else {}
        of = self._transfer.solid, seen, self._camera, self._size
        found = [known[b.key] if b.key in known else shares_seen(*of, b.targets) for b in beams]
        self._shares = self._num_eyes, {beam.key: share for beam, share in zip(beams, found, strict=True)}
        return found

    def _wanted(self, shown: Look, vectors: Arriving) -> Wanted:
        gain = np.array(gain_of(shown, self._solo), np.float32)
        is_exact_but_for_surfaces = self._vectors.follow(self._asked())
        is_rough = self._is_rough and not is_exact_but_for_surfaces
        # what is added to a frame is the error of a fine one
        is_fine = not self._is_watched or self.is_corrected
        return Wanted(shown, self._materials_of(shown), self._now(), gain, vectors, is_rough, self._relief, is_fine)

    def parts(self) -> tuple[dict[str, Part], Numbers]:
        """What a shader needs to draw what is shown, from anywhere; after a step."""
        assert self._look is not None
        vectors = self._vectors_now(self._everywhere)
        self._num_told += vectors is not self._told
        self._told = vectors
        wanted = self._wanted(self._look, vectors)
        # what is exact follows from its light alone: it is not sent again after pictures that were drawn here meanwhile
        versions = self._num_materials, self._num_told if self._is_rough else self._asked()
        return parts_of(self._transfer, wanted, versions), numbers_of(self._transfer, wanted)

    @property
    def seen(self) -> Seen:
        """What its rays see."""
        return self._look_around()

    def along_middles(self, size: tuple[int, int], *, is_fine: bool = True) -> tuple[F32, Seen]:
        """What it shows along the rays through the middles of the pixels of a picture of another size.

        Args:
            size: width and height in pixels. is_fine: with highlights as where the eye rests, not as while it moves.
        Returns:
            Linear radiance (height, width, 3) float32, and what the rays see.
        """
        assert self._look is not None
        seen = self._looked(size).middles(size[0] * size[1])
        wanted = self._wanted(self._look, self._vectors_now(seen.is_needed))._replace(is_fine=is_fine)
        of = self._transfer.solid, seen, self._camera, size
        shares = [shares_seen(*of, beam.targets) for beam in wanted.arriving.beams]
        return frame_of(self._transfer, wanted, seen, self._camera, size, shares).image, seen

    @property
    def surface(self) -> Surface:
        """What is seen."""
        return self._transfer.surface

    def _now(self) -> Light:
        assert self._light is not None
        return self._light

    def _look_around(self) -> Seen:
        if self._seen is None or self._seen[0] != self._num_eyes:
            self._seen = self._num_eyes, self._looked(self._size)
        return self._seen[1]

    def _looked(self, size: tuple[int, int]) -> Seen:
        found = look(self._transfer.surface, self._transfer.embree, self._camera, size)
        mend(found, self._transfer.parted, self._transfer.solid)
        return found

    def _materials_of(self, shown: Look) -> Materials:
        before_of, before = self._materials
        if before is None or before_of is not shown:
            names = self._transfer.material_names
            normals = [shown.materials[name].normals for name in names]
            terms = [documents_of(shown, name) for name in names]
            found = Materials.of(terms, before, normals, waits=not self._is_watched)
            self._num_materials += found is not before
            self._materials = shown, found
            return found
        return before

    def _vectors_now(self, is_needed: NDArray[np.uint8]) -> Arriving:
        """Light vectors in the light of the look; where they may be rough, of what is needed alone."""
        asked = self._asked()
        return self._vectors.quickly(asked, is_needed) if self._is_rough else self._vectors.exactly(asked)

    def all_tiles(self) -> list[Tile]:
        """Tiles that cover the picture: one, for all of it changes together."""
        return [(0, 0, *self._size)]

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Payload of a frame: the tiles one after another, row-major."""
        drawn = self._draw()
        if drawn is not None and self._by is None and form == "rgb9e5" and list(tiles) == self.all_tiles():
            return drawn.packed().tobytes()
        image = self._image()
        parts = [image[y : y + height, x : x + width].reshape(-1, 3) for x, y, width, height in tiles]
        return encode_pixels(np.ascontiguousarray(np.concatenate(parts)), form)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """How much each pixel of tiles hides of display values behind it; see `Picture.encode_alpha`."""
        alpha = self.alpha(for_display=True)
        return None if alpha is None else encode_coverage(alpha, tiles)

    def alpha(self, *, for_display: bool) -> F32 | None:
        """The same of the whole picture, or of linear radiance; None where it hides all. (height, width) float32"""
        drawn = self._draw()
        hides = None if drawn is None else drawn.frame.hides
        return None if hides is None else alpha_of(hides, for_display=for_display)

    def image(self) -> F32:
        """Linear radiance. (height, width, 3) float32"""
        return self._image().copy()  # the next edit writes to it

    def _image(self) -> F32:
        drawn = self._draw()
        if drawn is None:
            return np.zeros((*self._size[::-1], 3), np.float32)
        return drawn.frame.image if self._by is None else corrected(drawn.frame.image, self._by)

    def probe(self, x: int, y: int) -> dict[str, Any]:
        """What a pixel shows, and where its surface is.

        Raises:
            ParameterError: it lies outside the picture.
        """
        image = self._image()
        height, width, _ = image.shape
        if not (0 <= x < width and 0 <= y < height):
            raise ParameterError("pixel", [x, y], f"x below {width} and y below {height}")
        found: dict[str, Any] = {"material": None, "position": None, "normal": None, "bands": None, "curve": None}
        found["radiance"] = image[y, x].copy()
        if self._seen is None:
            return found
        seen, surface = self._seen[1], self._transfer.surface
        row = seen.first_row(y * width + x)
        face = int(seen.hits.face[row])
        if face < 0:
            return found
        place = self._camera.to_world[:3, 3] + float(seen.hits.distance[row]) * seen.directions[row]
        normal = seen.weight[row] @ surface.vertices.normal[seen.vertex[row]]
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
            NotMadeError: always.
        """
        raise NotMadeError("which pixels a curve lights is known where the eye rests; ask when its picture is exact")
