"""The image of a free camera under a look that changes; rendered as a whole for every frame."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from typing import Any

import numpy as np
from jaxtyping import Shaped
from numpy.typing import NDArray

from relume.assets.btf.btf_memory import check_btfs_fit
from relume.core.errors import ParameterError, ResultUnavailableError
from relume.live.fixed_camera.edit_pointers import CurvePointer, ParameterPointer, check_exists, parse_pointer
from relume.live.fixed_camera.fidelity import Fidelity
from relume.live.fixed_camera.illumination import (
    Illumination,
    Solo,
    emission_images,
    geometries,
    illumination_from_look,
    images_by_material,
    links,
    picture_gain,
)
from relume.live.fixed_camera.jobs import Job, Priority
from relume.live.fixed_camera.picture import Progress
from relume.live.fixed_camera.view_images import material_documents
from relume.live.free_camera.adaptive_shadows import visible_fractions
from relume.live.free_camera.background import alpha
from relume.live.free_camera.browser.material_arrays import ArrayBlock, ShaderConstants, array_blocks, shader_constants
from relume.live.free_camera.frame import (
    Frame,
    FrameRequestState,
    MaterialState,
    PreviousImage,
    only_materials_differ,
    render_frame,
    shows_btf,
    update_for_materials,
)
from relume.live.free_camera.glass import edited_rules
from relume.live.free_camera.hard_shadow_lights import HardShadowLight
from relume.live.free_camera.highlight_edges import render_fine_frame
from relume.live.free_camera.incident_light import IncidentCoefficients
from relume.live.free_camera.incremental_frame import DirtyPixels, find_dirty_pixels
from relume.live.free_camera.lobe_terms import has_traced_lobe
from relume.live.free_camera.occluded_probes import reweight
from relume.live.free_camera.primary_visibility import GBuffer, trace_primary
from relume.live.free_camera.probe_light import LightRequest, ProbeLightState
from relume.live.free_camera.protocol import FreeCameraTransfer
from relume.live.free_camera.texel_brdf.texel_tables import get_texel_tables
from relume.live.free_camera.texel_brdf.texture_frame_light import TexelLight
from relume.look import Look
from relume.look.glass import GlassOfLook, glass_of
from relume.look.object_materials import object_materials_of
from relume.math.zernike import degree_of
from relume.scene.model import Camera
from relume.transport.lobe_scene import LobeScene
from relume.views.resolve import encode_coverage, encode_pixels

F32 = NDArray[np.float32]
Tile = tuple[int, int, int, int]


class FreeCameraPicture:
    """The image of one session; used from one thread at a time.

    Args:
        is_watched: a user waits for it, so that approximate images are shown first if better ones take long, and fine
            highlights only when camera and light have stopped.

    Attributes:
        renders_pixels: its pixels are needed at every step; otherwise a browser renders from `array_blocks`, and pixels
            are rendered on request.
    """

    def __init__(self, transfer: FreeCameraTransfer, view_name: str, *, is_watched: bool = False) -> None:
        view = transfer.views[view_name]
        self._camera, self._size = view.camera, (view.width, view.height)
        self._camera_seq = 0  # increases with each camera
        self._look: Look | None = None
        self._light: Illumination | None = None
        self._solo: Solo = None
        self._is_watched = is_watched
        self._is_coarse = False  # the displayed light is approximate
        self._is_stale = False  # the frame is outdated: its pixels were not requested
        self._residual_image: F32 | None = None  # residual that is added to the frame
        self._is_refined = False  # a job has refined the frame since the last step
        self.renders_pixels = True
        self._vectors_version = self._materials_version = 0
        self._open(transfer)

    def _open(self, transfer: FreeCameraTransfer) -> None:
        """Show a bake; nothing of another one is shown further."""
        self._transfer = transfer
        self._displayed: tuple[Any, ...] | None = None
        self._previous: PreviousImage | None = None
        self._dirty_cache: tuple[GBuffer, bytes, DirtyPixels] | None = None
        self._gbuffer: tuple[int, GBuffer] | None = None
        self._glass: tuple[GlassOfLook, F32 | None] = (), None  # of the look, and its rules
        self._materials: tuple[tuple[Look, bool] | None, MaterialState | None] = None, None
        self._probe_light, self._all_probes = ProbeLightState(transfer), np.ones(transfer.vectors_shape[0], np.uint8)
        self._shadow_visibility: tuple[int, dict[Hashable, F32]] = 0, {}  # of hard-shadow lights, for a camera
        self._texel_light = TexelLight()
        # of the latest light that it is known for, with and without indirect light
        self._lobe_scenes: dict[bool, tuple[Illumination, LobeScene]] = {}
        self._narrow_look: tuple[Look | None, bool] = None, False  # whether the look has narrow terms
        self._published_vectors: IncidentCoefficients | None = None

    def check(self, look: Look) -> None:
        """Check that a look can be shown: tables represent any number of terms, but BTFs may be too large together.

        Raises:
            MemoryBudgetError: its BTFs exceed the memory budget.
        """
        check_btfs_fit(term for material in look.materials.values() for term in material.terms)

    def set_look(self, look: Look, *, active_pointer: str | None = None, solo: Solo = None) -> None:
        """Set a new target; nothing is computed yet.

        Args:
            look: the target. active_pointer: pointer to the active control, or None.
            solo: names of the only light sources to show, see `illumination_from_look`; None: all.
        Raises:
            ParameterError: `active_pointer` does not point to an editable control, a light is linked to an object that
                the scene does not have, or the images of a material cannot be transformed. NotFoundError,
                SceneError: the environment is not available. The picture is unchanged.
        """
        if active_pointer is not None:
            parse_pointer(active_pointer)
        transfer = self._transfer.with_object_materials(object_materials_of(look))
        names = transfer.material_names
        images = emission_images(geometries(look), transfer.emission_image)
        transfer.check_links(links(look))
        own = transfer.with_own_images(look)
        light = illumination_from_look(own, names, has_bounces=True, solo=solo, images=images)
        transfer.environment_map(light.environment.map)  # raises now if it is not available
        if transfer is not self._transfer:
            self._open(transfer)
        self._look, self._light, self._solo = look, light, solo
        if (glass := glass_of(look)) != self._glass[0]:
            self._glass = glass, edited_rules(self._transfer.embree, names, self._transfer.glass, glass)
        self.correct(None)

    def set_camera(self, camera: Camera, size: tuple[int, int]) -> None:
        """Set the camera and the image size; nothing is computed yet.

        Args:
            camera: with a rigid transform. size: width and height in pixels.
        """
        self._camera, self._size = camera, size
        self._camera_seq += 1
        self.correct(None)

    def correct(self, residual_image: Shaped[F32, "height width 3"] | None) -> None:
        """Add a residual until the look or camera changes, see `relume.live.free_camera.static_view_jobs`.

        Args:
            residual_image: per pixel, float32; None: none.
        """
        self._is_refined |= residual_image is not None or self.is_corrected
        self._residual_image = residual_image

    def unwatched(self) -> FreeCameraPicture:
        """Return a new picture of the same camera, with all of its light and fine highlights."""
        picture = FreeCameraPicture(self._transfer, next(iter(self._transfer.views)))
        picture.set_camera(self._camera, self._size)
        if self._gbuffer is not None and self._gbuffer[0] == self._camera_seq:
            picture._gbuffer = picture._camera_seq, self._gbuffer[1]
        picture._lobe_scenes = self._lobe_scenes
        return picture

    @property
    def exceeds_browser(self) -> bool:
        """True for what the browser's renderer does not have: a residual, object materials, whose surfaces and probes
        it lacks, and transformed texture coordinates."""
        has_transforms = self._look is not None and any(each.uv_transform for each in self._look.materials.values())
        return self.is_corrected or bool(self._transfer.object_materials) or has_transforms

    @property
    def is_corrected(self) -> bool:
        """True if a residual is added."""
        return self._residual_image is not None

    @property
    def sized_camera(self) -> tuple[Camera, tuple[int, int]]:
        """The camera and the image size."""
        return self._camera, self._size

    def prepare(self, pointer: str) -> None:
        """Validate a pointer to a control; nothing needs to be prepared.

        Raises:
            ParameterError: there is no such control.
        """
        parsed = parse_pointer(pointer)
        if isinstance(parsed, CurvePointer | ParameterPointer) and self._look is not None:
            check_exists(parsed, self._look)

    def next_job(self) -> Job | None:
        """Return the next refinement: missing incident coefficients, then BTFs, then highlight edges."""
        if self._is_coarse and self._must_be_coarse():
            return self._probe_light.next_job(self._light_request(), self._needed_probes)
        if self._look is not None and (missing := self._material_state(self._look).btf_materials.missing):
            return self._tables_job(missing[0].data, missing[0].components)
        if not (self._is_watched and self.renders_pixels):
            return None
        if self._look is not None and self._has_narrow_lobes(self._look):
            light = self._current_light()
            if light.paths.has_indirect and not self._is_lobe_scene_current(light):
                return self._lobe_job(light)
        return self._refine_job()

    def _tables_job(self, data: str, components: int) -> Job:
        """Return the job for the tables of a BTF, seconds for 128 × 128 texels; until then its mean is displayed."""

        def display(tables: object) -> None:
            self._materials, self._displayed = (None, self._materials[1]), None

        return Job(
            ("BTF tables", data, components),
            "measured texture",
            Priority.CONTROL,
            lambda progress, is_canceled: get_texel_tables(data, components),
            display,
            state="precomputing",
            is_resumable=True,
        )

    def _refine_job(self) -> Job | None:
        """Return the job that refines highlights in the displayed image, if they are not fine."""
        previous = self._previous
        if (
            previous is None
            or previous.has_highlight_edges
            or self._is_stale
            or self._is_coarse
            or self._target != self._displayed
        ):
            return None
        # runs in the background; frames keep their own cached texel light
        fine_state = previous.state._replace(is_fine=True, texel_light=TexelLight())
        args = self._transfer, fine_state, previous.gbuffer, self._camera, self._size, previous.shadow_visibility

        def accept_frame(frame: Frame) -> None:
            if self._previous is previous and not self._is_stale and not previous.has_highlight_edges:
                self._previous = PreviousImage(
                    fine_state, previous.gbuffer, frame, previous.shadow_visibility, has_highlight_edges=True
                )
                self._is_refined = True

        return Job(
            ("highlights", self._camera_seq, id(previous.state)),
            "finer highlights",
            Priority.REFINEMENT,
            lambda progress, is_canceled: render_fine_frame(*args),
            accept_frame,
        )

    @property
    def _target(self) -> tuple[Any, ...]:
        """The requested state; equal to `_displayed` if it is displayed."""
        return self._look, self._solo, self._camera_seq, self._probe_light.version

    def advance(self, max_coefficients: int | None) -> Progress:
        """Update the image to its look and camera."""
        target = self._target
        is_displayed = target == self._displayed and self._is_coarse == self._must_be_coarse()
        if self._look is None or (is_displayed and not self._is_refined):
            return self._progress([])
        self._is_refined = False
        if not is_displayed:
            self._is_coarse = self._must_be_coarse()
            self._is_stale, self._displayed = True, target
        if self.renders_pixels:
            self._render()
        return self._progress(self.all_tiles())

    def _progress(self, tiles: list[Tile]) -> Progress:
        """Return the result of a step. tiles: that have changed"""
        return Progress(tiles, exact=False, fidelity=self._fidelity, complete=True, traces_lobes=self.traces_lobes)

    @property
    def traces_lobes(self) -> bool:
        """True if the look has narrow lobes."""
        return self._look is not None and self._has_narrow_lobes(self._look)

    @property
    def _fidelity(self) -> Fidelity:
        return Fidelity.PREVIEW if self._is_coarse else Fidelity.APPROXIMATE

    def _must_be_coarse(self) -> bool:
        """Return whether a user would wait for incident coefficients that are not cached."""
        return self._is_watched and not self._probe_light.is_available(self._light_request())

    def _light_request(self) -> LightRequest:
        """Return the light request; hard shadows per pixel are not available in the browser's renderer."""
        return LightRequest(self._current_light(), self.renders_pixels)

    @property
    def _needed_probes(self) -> NDArray[np.uint8]:
        """Probes that need light: those of the camera, or all if the browser renders from any camera."""
        return self._current_gbuffer().is_needed if self.renders_pixels else self._all_probes

    def _render(self) -> PreviousImage | None:
        """Return the displayed frame, rendered if it is outdated; None before a look is set."""
        if not self._is_stale or self._look is None:
            return self._previous
        gbuffer, previous = self._current_gbuffer(), self._previous
        state = self._request_state(self._look, self._current_vectors(gbuffer.is_needed))
        self._is_stale, shadow_visibility = (
            False,
            self._trace_shadow_visibility(state.incident.hard_shadow_lights, gbuffer),
        )
        if previous is not None and self._can_update(previous, state, gbuffer):
            state = state._replace(is_fine=previous.state.is_fine)
            dirty = self._dirty_pixels(previous.state.materials, state.materials, gbuffer)
            update_for_materials(
                self._transfer,
                state,
                gbuffer,
                self._camera,
                previous.frame,
                dirty,
                previous.to_rgb9e5(),
                shadow_visibility,
            )
            previous.state, previous.has_highlight_edges = state, False
        else:
            render = render_fine_frame if state.is_fine else render_frame
            frame = render(self._transfer, state, gbuffer, self._camera, self._size, shadow_visibility)
            self._previous = PreviousImage(state, gbuffer, frame, shadow_visibility, has_highlight_edges=state.is_fine)
        return self._previous

    def _can_update(self, previous: PreviousImage, state: FrameRequestState, gbuffer: GBuffer) -> bool:
        """Return whether the previous frame may be updated; offline, all highlight edges are rendered anew."""
        is_same = (
            previous.gbuffer is gbuffer and not len(gbuffer.glass.ray) and only_materials_differ(previous.state, state)
        )
        if not (is_same and self._is_watched):
            return False
        dirty = self._dirty_pixels(previous.state.materials, state.materials, gbuffer)
        return not shows_btf(self._transfer, state.materials, gbuffer, dirty.region)

    def _dirty_pixels(self, before: MaterialState, after: MaterialState, gbuffer: GBuffer) -> DirtyPixels:
        """Return the pixels that show edited materials; cached during a drag."""
        is_changed = np.array([old is not new for old, new in zip(before.projected, after.projected, strict=True)])
        key = is_changed.tobytes()
        if self._dirty_cache is None or self._dirty_cache[0] is not gbuffer or self._dirty_cache[1] != key:
            num_pixels = self._size[0] * self._size[1]
            self._dirty_cache = (
                gbuffer,
                key,
                find_dirty_pixels(self._transfer.stored_scene, gbuffer, is_changed, num_pixels),
            )
        return self._dirty_cache[2]

    def _trace_shadow_visibility(self, hard_shadow_lights: Sequence[HardShadowLight], gbuffer: GBuffer) -> list[F32]:
        """Return the visibility of each hard-shadow light along camera rays; cached until the camera or light moves."""
        cached = self._shadow_visibility[1] if self._shadow_visibility[0] == self._camera_seq else {}
        visibility = [
            cached[light.key] if light.key in cached else self._visible_fractions(light, gbuffer)
            for light in hard_shadow_lights
        ]
        self._shadow_visibility = (
            self._camera_seq,
            {light.key: fractions for light, fractions in zip(hard_shadow_lights, visibility, strict=True)},
        )
        return visibility

    def _visible_fractions(self, light: HardShadowLight, gbuffer: GBuffer) -> F32:
        mesh = self._transfer.occlusion_mesh._replace(embree=light.casters)
        return visible_fractions(mesh, gbuffer, self._camera, self._size, light.targets)

    def _request_state(self, look: Look, incident: IncidentCoefficients) -> FrameRequestState:
        gain = np.array(picture_gain(look, self._solo), np.float32)
        only_indirect_pending = self._probe_light.only_indirect_pending(self._light_request())
        is_coarse = self._is_coarse and not only_indirect_pending
        # the residual is that of a fine frame
        is_fine = not self._is_watched or self.is_corrected
        return FrameRequestState(
            look,
            self._material_state(look),
            self._current_light(),
            gain,
            incident,
            is_coarse,
            self._current_lobe_scene(),
            self._texel_light,
            is_fine,
        )

    def array_blocks(self) -> tuple[dict[str, ArrayBlock], ShaderConstants]:
        """Return the arrays and constants with which a browser renders the displayed look; call it after `advance`."""
        assert self._look is not None
        incident = self._current_vectors(self._all_probes)
        self._vectors_version += incident is not self._published_vectors
        self._published_vectors = incident
        state = self._request_state(self._look, incident)
        # exact coefficients depend on the light alone: they are not sent again after frames rendered here meanwhile
        versions = self._materials_version, self._vectors_version if self._is_coarse else self._light_request()
        return array_blocks(self._transfer, state, versions), shader_constants(self._transfer, state)

    @property
    def gbuffer(self) -> GBuffer:
        """The G-buffer of its rays."""
        return self._current_gbuffer()

    def render_moving(self, *, only_centers: bool = False) -> tuple[Shaped[F32, "height width 3"], GBuffer]:
        """Render the image of a moving camera anew: without fine highlights, and without a residual.

        Args:
            only_centers: one ray for each pixel, and none behind glass.
        Returns:
            Linear radiance, float32, and the G-buffer.
        """
        assert self._look is not None
        gbuffer = self._current_gbuffer()
        if only_centers:
            gbuffer = gbuffer.pixel_centers(self._size[0] * self._size[1])
        state = self._request_state(self._look, self._current_vectors(gbuffer.is_needed))._replace(is_fine=False)
        shadow_visibility = [self._visible_fractions(light, gbuffer) for light in state.incident.hard_shadow_lights]
        return render_frame(self._transfer, state, gbuffer, self._camera, self._size, shadow_visibility).image, gbuffer

    def _current_light(self) -> Illumination:
        assert self._light is not None
        return self._light

    def _current_gbuffer(self) -> GBuffer:
        if self._gbuffer is None or self._gbuffer[0] != self._camera_seq:
            self._gbuffer = self._camera_seq, self._trace_gbuffer(self._size)
        (_, gbuffer), rules = self._gbuffer, self._glass[1]
        if len(gbuffer.glass.ray) and rules is not None and gbuffer.glass.rules is not rules:
            gbuffer = gbuffer.with_glass_rules(self._transfer.stored_scene, self._transfer.embree, rules)
            self._gbuffer = self._camera_seq, gbuffer
        return gbuffer

    def _trace_gbuffer(self, size: tuple[int, int]) -> GBuffer:
        scene_args = self._transfer.stored_scene, self._transfer.embree
        gbuffer = trace_primary(*scene_args, self._camera, size, self._glass[1])
        reweight(gbuffer, self._transfer.has_occluded_neighbor, self._transfer.occlusion_mesh)
        return gbuffer

    def _material_state(self, look: Look) -> MaterialState:
        traces_lobes = self._current_lobe_scene() is not None
        key, previous = self._materials
        if previous is None or key is None or key[0] is not look or key[1] != traces_lobes:
            names = self._transfer.material_names
            normals = [look.materials[name].normals for name in names]
            terms = [material_documents(look, name) for name in names]
            counts = [look.materials[name].basis_functions for name in names]
            images = images_by_material(emission_images(geometries(look), self._transfer.emission_image))
            emission = [images.get(name) for name in names]
            materials = MaterialState.from_terms(
                terms,
                previous,
                normals,
                emission,
                [look.materials[name].uv_transform for name in names],
                [None if count is None else degree_of(count) for count in counts],
                is_blocking=not self._is_watched,
                traces_lobes=traces_lobes,
            )
            self._materials_version += materials is not previous
            self._materials = (look, traces_lobes), materials
            return materials
        return previous

    def _has_narrow_lobes(self, look: Look) -> bool:
        """Return whether a material of a look has terms for lobe rays."""
        if self._narrow_look[0] is not look:
            documents = (material_documents(look, name) for name in self._transfer.material_names)
            self._narrow_look = look, any(map(has_traced_lobe, documents))
        return self._narrow_look[1]

    def _current_lobe_scene(self) -> LobeScene | None:
        """Return what lobe rays meet, in the latest light that it is known for; None if they are not traced."""
        light = self._current_light()
        assert self._look is not None
        if not self.renders_pixels or not self._has_narrow_lobes(self._look):
            return None
        has_indirect = light.paths.has_indirect
        # without indirect light, nothing is solved
        if not (self._is_watched and has_indirect) and not self._is_lobe_scene_current(light):
            self._keep_lobe_scene(light, self._transfer.lobe_scene(light, lambda: False))
        latest = self._lobe_scenes.get(has_indirect) or self._lobe_scenes.get(False)
        return None if latest is None else latest[1]

    def _keep_lobe_scene(self, light: Illumination, scene: LobeScene) -> None:
        """Keep the scene that lobe rays meet in a light; copies of the picture keep theirs."""
        self._lobe_scenes = {**self._lobe_scenes, light.paths.has_indirect: (light, scene)}

    def _is_lobe_scene_current(self, light: Illumination) -> bool:
        """Return whether the scene that lobe rays meet is known in a light."""
        scene = self._lobe_scenes.get(light.paths.has_indirect)
        return scene is not None and scene[0] == light

    def _lobe_job(self, light: Illumination) -> Job:
        """Return the job for the light that lobe rays meet; until then rays meet that of the previous look."""

        def display(scene: LobeScene) -> None:
            self._keep_lobe_scene(light, scene)
            self._materials, self._displayed = (None, self._materials[1]), None

        return Job(
            ("lobe rays", self._transfer.key, light),
            "light in reflections",
            Priority.REFINEMENT,
            lambda progress, is_canceled: self._transfer.lobe_scene(light, is_canceled),
            display,
        )

    def _current_vectors(self, is_needed: NDArray[np.uint8]) -> IncidentCoefficients:
        """Incident coefficients of the look's light; approximate ones only for needed probes."""
        request = self._light_request()
        return self._probe_light.fast(request, is_needed) if self._is_coarse else self._probe_light.exact(request)

    def all_tiles(self) -> list[Tile]:
        """Return the tiles that cover the image: one, since all pixels change together."""
        return [(0, 0, *self._size)]

    def encode(self, tiles: Sequence[Tile], form: str) -> bytes:
        """Return the payload of a frame: the tiles in order, row-major."""
        previous = self._render()
        if (
            previous is not None
            and self._residual_image is None
            and form == "rgb9e5"
            and list(tiles) == self.all_tiles()
        ):
            return previous.to_rgb9e5().tobytes()
        image = self._image()
        pixels = [image[y : y + height, x : x + width].reshape(-1, 3) for x, y, width, height in tiles]
        return encode_pixels(np.ascontiguousarray(np.concatenate(pixels)), form)

    def encode_alpha(self, tiles: Sequence[Tile]) -> bytes | None:
        """Return the alpha of each pixel in tiles over display values; see `Picture.encode_alpha`."""
        alpha = self.alpha(for_display=True)
        return None if alpha is None else encode_coverage(alpha, tiles)

    def alpha(self, *, for_display: bool) -> Shaped[F32, "height width"] | None:
        """Return the alpha of the whole image over display values or linear radiance; None if it is opaque."""
        previous = self._render()
        coverage = None if previous is None else previous.frame.coverage
        return None if coverage is None else alpha(coverage, for_display=for_display)

    def image(self) -> Shaped[F32, "height width 3"]:
        """Return linear radiance."""
        return self._image().copy()  # the next edit writes to it

    def _image(self) -> F32:
        previous = self._render()
        if previous is None:
            return np.zeros((*self._size[::-1], 3), np.float32)
        return (
            previous.frame.image
            if self._residual_image is None
            else np.maximum(previous.frame.image + self._residual_image, 0)
        )

    def inspect(self, x: int, y: int) -> dict[str, Any]:
        """Probe a pixel: its radiance and surface.

        Raises:
            ParameterError: it lies outside the image.
        """
        image = self._image()
        height, width, _ = image.shape
        if not (0 <= x < width and 0 <= y < height):
            raise ParameterError("pixel", [x, y], f"x below {width} and y below {height}")
        info: dict[str, Any] = {"material": None, "position": None, "normal": None, "bands": None, "curve": None}
        info["radiance"] = image[y, x].copy()
        if self._gbuffer is None:
            return info
        gbuffer, stored_scene = self._gbuffer[1], self._transfer.stored_scene
        row = gbuffer.first_hit_row(y * width + x)
        face = int(gbuffer.hits.face[row])
        if face < 0:
            return info
        position = self._camera.to_world[:3, 3] + float(gbuffer.hits.distance[row]) * gbuffer.directions[row]
        normal = gbuffer.weight[row] @ stored_scene.lattice_nodes.normal[gbuffer.lattice_node[row]]
        return info | {
            "material": self._transfer.material_names[int(stored_scene.face_material[face])],
            "position": position,
            "normal": normal / max(float(np.linalg.norm(normal)), 1e-12),
        }

    def highlight_pixels(self, pointer: str, from_deg: float, to_deg: float) -> F32:
        """Raise an error: there are no operators for a free camera.

        Args:
            pointer: to a curve. from_deg, to_deg: ends of a range, degrees.

        Raises:
            ResultUnavailableError: always.
        """
        raise ResultUnavailableError(
            "the pixels that a curve lights are available when the camera stops; ask again when the image is exact"
        )
