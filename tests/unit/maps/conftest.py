from collections.abc import Iterator

import pytest
from tests.unit.maps.fakes import fake_registered


@pytest.fixture(autouse=True)
def _fake() -> Iterator[None]:
    with fake_registered():
        yield
