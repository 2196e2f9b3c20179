"""What the tests of the campaign share."""

import os
from collections.abc import Iterator

import pytest


@pytest.fixture(autouse=True)
def environment() -> Iterator[None]:
    """Take back what an engine says to numerical libraries."""
    before = dict(os.environ)
    yield
    os.environ.clear()
    os.environ.update(before)
