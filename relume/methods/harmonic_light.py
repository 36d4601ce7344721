"""Transfer of harmonics in a store: what smooth light brings to points and cells (`relume.project.harmonic_transfer`).

    harmonics/basis, cluster, weight     of points: ClusteredTransfer
    harmonics/irradiance, vectors        of cells: (C, NUM_HARMONICS), and of their first points (C, K, NUM_HARMONICS)

Found once in a bake, it serves while a hand turns or exchanges an environment.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from relume.bake import StoreReader
from relume.basis.harmonics import NUM_HARMONICS, harmonics
from relume.basis.zernike import QUICK_DEGREE, num_functions
from relume.errors import ChunkDamagedError
from relume.light.smooth import Divided, divide
from relume.light.triangles import TriangleLights
from relume.methods.cells.cell_light import CellLight
from relume.methods.last_read import LastRead
from relume.methods.store_io import read_cells, read_tiles, read_traced_directions
from relume.moving.points.surface import read_surface_points
from relume.project.harmonic_transfer import NUM_CLUSTERS, NUM_COMPONENTS, ClusteredTransfer, transfer_matrices

F32 = NDArray[np.float32]
F64 = NDArray[np.float64]

CELL_DEGREE = 2  # cells are seen from all around: in the mean little more is left of what they send


@dataclass(frozen=True)
class HarmonicLight:
    """Transfer of harmonics to the points and cells of a bake.

    Attributes:
        of_points: in the in-basis of `QUICK_DEGREE`.
        irradiance: of cells. (C, NUM_HARMONICS) float32
        vectors: of their first points, of `CELL_DEGREE`. (C, K, NUM_HARMONICS) float32
        brought: by the bake's lights in light that is a harmonic. (M, NUM_HARMONICS)
    """

    of_points: ClusteredTransfer
    irradiance: F32
    vectors: F32
    brought: F64

    @cached_property
    def divided(self) -> LastRead[TriangleLights, Divided]:
        """Divides light into what harmonics tell and what they do not; asked thrice for each."""
        return LastRead(lambda lights: divide(lights, self.brought))


def make_harmonic_light(store: StoreReader, seed: int) -> dict[str, NDArray[Any]]:
    """Find the arrays of a store in which points and cells know their lights. seed: of the clusters."""
    asked = read_traced_directions(store), read_tiles(store).solid_angles
    points, visible, cells = read_surface_points(store), store.read("points/visibility"), read_cells(store)

    def matrices(rows: NDArray[np.intp]) -> F32:
        return transfer_matrices(points.rows(rows), visible[rows], *asked, QUICK_DEGREE)

    clustered = ClusteredTransfer.of(points.num_points, matrices, np.random.default_rng(seed))
    of_points = transfer_matrices(
        cells.points, cells.visible.reshape(cells.points.num_points, cells.visible.shape[2]), *asked, 0
    )
    irradiance = np.sqrt(np.pi) * of_points.reshape(cells.num_cells, cells.points_a_cell, NUM_HARMONICS).mean(axis=1)
    every = np.arange(cells.num_cells)
    first = np.ascontiguousarray(cells.visible[:, 0])
    vectors = transfer_matrices(cells.first_points(every), first, *asked, CELL_DEGREE)
    return {
        **{f"harmonics/{name}": array for name, array in clustered._asdict().items()},
        "harmonics/irradiance": irradiance.astype(np.float16),
        "harmonics/vectors": vectors.astype(np.float16),
    }


def harmonic_bytes(num_points: int, num_cells: int) -> int:
    """What its arrays need in a store, at most."""
    basis = 2 * NUM_CLUSTERS * (1 + NUM_COMPONENTS) * num_functions(QUICK_DEGREE) * NUM_HARMONICS
    of_points = num_points * (1 + 2 * NUM_COMPONENTS)
    return basis + of_points + 2 * num_cells * (1 + num_functions(CELL_DEGREE)) * NUM_HARMONICS


def read_harmonic_light(store: StoreReader, cells: CellLight) -> HarmonicLight | None:
    """Read it; None where a store has none, as those of fixed views and of earlier versions.

    Raises:
        ChunkDamagedError: arrays of the store do not fit each other.
    """
    if not store.attributes.get("has_harmonics"):
        return None
    of_points = ClusteredTransfer(*(store.read(f"harmonics/{name}") for name in ClusteredTransfer._fields))
    irradiance, vectors = (store.read(f"harmonics/{name}").astype(np.float32) for name in ("irradiance", "vectors"))
    shape = num_functions(QUICK_DEGREE), NUM_HARMONICS
    fits = len(of_points.cluster) == len(of_points.weight) == store.shape("points/material")[0]
    fits = fits and of_points.basis.shape[1:] == (1 + of_points.weight.shape[1], *shape)
    fits = fits and int(of_points.cluster.max(initial=0)) < len(of_points.basis)
    of_cells = cells.num_cells, num_functions(CELL_DEGREE), NUM_HARMONICS
    if not (fits and irradiance.shape == of_cells[::2] and vectors.shape == of_cells):
        raise ChunkDamagedError("harmonics", "they do not fit the points and cells")
    brought = harmonics(read_traced_directions(store).astype(np.float64)) * read_tiles(store).solid_angles[:, None]
    return HarmonicLight(of_points, irradiance, vectors, brought)
