"""The look that tests edit."""

from __future__ import annotations

import pytest
from example_look import LIGHTS, MATERIALS

from relume.look import default_look


@pytest.fixture
def default():
    return default_look(MATERIALS, LIGHTS)
