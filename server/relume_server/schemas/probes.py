"""The body of /api/bakes/{id}/surface: what the shaders of a moving view are written from."""

from __future__ import annotations

from relume_server.schemas.base import Body


class RecurrenceBody(Body):
    """How the functions of the in-basis follow from each other; see `relume.math.zernike.Recurrence`."""

    order: list[int]
    norm: list[float]
    cosine: list[int]
    sine: list[int]
    a: list[float]
    b: list[float]
    c: list[float]


class LobeListsBody(Body):
    """Lists of lights that lobes look for: `side` of the map of directions, how many are `listed` for each and how many
    `lights_a_lamp`; the `narrowest` σ, radians, of so many `widths`, each √2 times the one before."""

    side: int
    listed: int
    lights_a_lamp: int
    narrowest: float
    widths: int


class LobeShapesBody(Body):
    """Sizes of tables of highlights, see `relume.live.free_camera.basis.lobe_shapes`.

    Rings, half an octave each, from the float that has the bits `least_bits`; spokes; widths of lights."""

    rings: int
    spokes: int
    widths: int
    least_bits: int


class FreeCameraBody(Body):
    """Sizes of the tables: K functions, rows over θo, columns over φo. `expansions` of leaning normals, (3, K).
    `first_points`: where those of each material begin, and one more at the end. `arrays` are the names of what GET
    /api/bakes/{id}/surface/{array} gives. `has_holes`: some surfaces are not everywhere, which the
    arrays do not say: pictures of the server show it."""

    functions: int
    rows: int
    columns: int
    ladder: RecurrenceBody
    expansions: list[list[float]]
    first_points: list[int]
    lobe_lists: LobeListsBody
    shapes: LobeShapesBody
    has_holes: bool
    arrays: list[str]
