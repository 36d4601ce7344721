"""The body of /api/bakes/{id}/probes: what the shaders of a moving view are written from."""

from __future__ import annotations

from relume_server.schemas.base import Body


class RecurrenceBody(Body):
    """How the functions of the Zernike basis follow from each other; see `relume.math.zernike.Recurrence`."""

    order: list[int]
    norm: list[float]
    cosine: list[int]
    sine: list[int]
    a: list[float]
    b: list[float]
    c: list[float]


class LobeListsBody(Body):
    """Lists of lights that lobes look for: `bins_per_side` of the map of directions, `max_listed` for each
    bin, `lights_per_bright_light`; `min_width` is the least σ, radians, of so many `widths`, each √2 times the one
    before."""

    bins_per_side: int
    max_listed: int
    lights_per_bright_light: int
    min_width: float
    widths: int


class LobeShapesBody(Body):
    """Sizes of tables of highlights, see `relume.live.free_camera.basis.lobe_shapes`.

    Rings, half an octave each, from the float that has the bits `min_bits`; azimuths; widths of lights."""

    elevation_rings: int
    azimuths: int
    widths: int
    min_bits: int


class FreeCameraBody(Body):
    """Sizes of the tables: `num_basis` K functions, rows over θo, columns over φo. `gradient_basis` for mapped normals,
    (3, K). `first_probes`: where those of each material begin, and one more at the end. `arrays` are the names of what
    GET /api/bakes/{id}/probes/{array} gives. `has_alpha_test`: some surfaces are not everywhere, which the arrays do
    not say: pictures of the server show it."""

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
