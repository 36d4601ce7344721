"""One measured material for all tests here; making it takes a second."""

import pytest
from leaves import by_leaves
from merl_files import planes_of
from shared_bakes import baked, corner, gathered, transfer

from relume.measured.asset_store import STORE, keep, records
from relume.measured.lookup import table_of
from relume.measured.merl import write_merl

__all__ = ["baked", "by_leaves", "corner", "gathered", "transfer"]  # fixtures


@pytest.fixture(scope="session")
def planes():
    made = planes_of()
    made.flags.writeable = False
    return made


@pytest.fixture(scope="session")
def table(planes):
    made = table_of(planes)
    made.flags.writeable = False
    return made


@pytest.fixture(scope="session")
def shelf(planes, tmp_path_factory):
    """A folder with one imported material, in use."""
    folder = tmp_path_factory.mktemp("measured")
    write_merl(folder / "plastic.binary", planes)
    with STORE.at(folder / "materials") as materials:
        keep(materials, folder / "plastic.binary", "Plastic")
        yield materials


@pytest.fixture(scope="session")
def data(shelf):
    """How look documents name it."""
    return records(shelf)[0].data
