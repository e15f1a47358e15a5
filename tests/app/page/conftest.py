"""Server of viser, without a browser, in which the tests of the page build their part of it."""

from collections.abc import Iterator

import pytest
import viser

from tests.waiting import free_port


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    try:
        yield server
    finally:
        server.stop()
