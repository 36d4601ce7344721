"""Bodies of IES files."""

from __future__ import annotations

from relume_server.schemas.base import Body


class IesBody(Body):
    """An IES file that point and spot lights of looks can use as `profile`.

    `candela`: its maximum intensity. `emission`: of a light with that intensity, W/sr. `warnings`: simplifications when
    it was read. `planes`: intensity over the maximum in the planes C0, C90, C180 and C270, every 5° from the nadir.
    """

    id: str
    profile: str
    name: str
    created: str
    candela: float
    emission: float
    warnings: list[str]
    planes: list[list[float]]
