"""Body of /api/bakes/{id}/probes: constants for the shaders of free-camera views."""

from __future__ import annotations

from relume_server.schemas.base import Body


class RecurrenceBody(Body):
    """Recurrence table of the Zernike basis; see `relume.math.zernike.Recurrence`."""

    order: list[int]
    norm: list[float]
    cosine: list[int]
    sine: list[int]
    a: list[float]
    b: list[float]
    c: list[float]


class LobeListsBody(Body):
    """Light lists for lobes: `bins_per_side` of the map of direction bins, `max_listed` lights per bin,
    `lights_per_bright_light`; `min_width` is the smallest σ in radians of `widths` steps, each √2 times the one before.
    """

    bins_per_side: int
    max_listed: int
    lights_per_bright_light: int
    min_width: float
    widths: int


class LobeShapesBody(Body):
    """Sizes of the highlight tables, see `relume.live.free_camera.basis.lobe_shapes`.

    Rings of half an octave, starting at the float with the bits `min_bits`; azimuths; light widths.
    """

    elevation_rings: int
    azimuths: int
    widths: int
    min_bits: int


class FreeCameraBody(Body):
    """Sizes of the tables: `num_basis` K functions, rows over θo, columns over φo. `gradient_basis` for mapped normals,
    (3, K). `first_probes`: index of the first probe of each material, and the total. `arrays` are the names for GET
    /api/bakes/{id}/probes/{array}. `has_alpha_test`: some surfaces are alpha-tested, which the arrays do not contain;
    only images of the server show it.
    """

    num_basis: int
    table_rows: int
    table_columns: int
    recurrence: RecurrenceBody
    gradient_basis: list[list[float]]
    first_probes: list[int]
    lobe_lists: LobeListsBody
    shapes: LobeShapesBody
    has_alpha_test: bool
    arrays: list[str]
