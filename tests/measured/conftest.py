"""One measured material for all tests here; making it takes a second."""

import pytest
from merl_files import planes_of

from relume.measured.lookup import table_of


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
