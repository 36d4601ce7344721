"""One measured material for all tests in this folder; making it takes a second."""

import pytest
from merl_files import make_planes
from shared_bakes import baked, corner, gathered, transfer
from subdivided_shading import shade_with_projector

from relume.assets.measured.interpolate import build_table
from relume.assets.measured.measured_store import STORE, records, store_material
from relume.assets.measured.merl import write_merl

__all__ = ["baked", "corner", "gathered", "shade_with_projector", "transfer"]  # fixtures


@pytest.fixture(scope="session")
def planes():
    measured_planes = make_planes()
    measured_planes.flags.writeable = False
    return measured_planes


@pytest.fixture(scope="session")
def table(planes):
    merl_table = build_table(planes)
    merl_table.flags.writeable = False
    return merl_table


@pytest.fixture(scope="session")
def library(planes, tmp_path_factory):
    """A library folder with one imported material, in use."""
    folder = tmp_path_factory.mktemp("measured")
    write_merl(folder / "plastic.binary", planes)
    with STORE.with_search_folder(folder / "materials") as materials:
        store_material(materials, folder / "plastic.binary", "Plastic")
        yield materials


@pytest.fixture(scope="session")
def data(library):
    """The name of the material in look documents."""
    return records(library)[0].data
