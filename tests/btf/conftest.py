"""A small synthetic BTF, made once, and where looks find it."""

import shutil
from pathlib import Path
from typing import NamedTuple

import pytest

from relume.btf.rings import ubo_rings
from relume.btf.shelf import STORE, BtfRecord
from relume.btf.values import Values
from relume.synthetic.corduroy import corduroy
from relume.synthetic.make import Made, make_btf
from relume.synthetic.render import SmallGeometry

SIZE, GRID = 16, 3


class Corduroy(NamedTuple):
    """folder: of the store. record: that it keeps. values: of it before compression."""

    folder: Path
    record: BtfRecord
    values: Values


@pytest.fixture(scope="session")
def small_btf(tmp_path_factory):
    folder = tmp_path_factory.mktemp("btf")
    with STORE.at(folder):
        rendered = tmp_path_factory.mktemp("values")
        values = Values(rendered, ubo_rings(), (SIZE, SIZE))
        small = SmallGeometry(corduroy(), ubo_rings(), (SIZE, SIZE), GRID, 1)
        values.fill(small.seen_from, lambda share: None, lambda: False)
        wanted = Made("corduroy", SIZE, GRID, 0.02)
        begun = folder / "making" / f"corduroy-{SIZE}-{GRID}-fitted"  # goes on where it was, at the end
        shutil.copytree(rendered, begun)
        record = make_btf(folder, wanted, "Corduroy", lambda share: None, lambda: False)
        yield Corduroy(folder, record, values)
