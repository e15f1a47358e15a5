"""The list of kept places."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import viser

from nerfnav_app.page.panels.place.place_library import PlaceLibraryPanel
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.queries.place_list import PlaceListQuery
from nerfnav_app.state.session import Session
from tests.app.places.test_library import brought


@pytest.fixture
def server() -> Iterator[viser.ViserServer]:
    server = viser.ViserServer(port=0, verbose=False)
    yield server
    server.stop()


def test_a_renamed_place_stays_chosen_so_that_delete_aims_at_it(
    server: viser.ViserServer, opened: Session, tmp_path: Path
) -> None:
    library = PlaceLibrary(tmp_path)
    for name in ("moon", "sun", "star"):
        brought(library, f"{name}.splat", name.encode())
    panel = PlaceLibraryPanel(server, lambda command: None, library)

    def listed(asked: int) -> Session:
        return PlaceListQuery((asked,)).apply(opened, library.entries())

    panel.show(listed(0))
    panel._list.value = "sun"
    (key,) = (place.key for place in library.entries() if place.name == "sun")
    library.rename(key, "aurora")
    panel.show(listed(1))
    assert panel._list.value == "aurora" and panel._chosen is not None and panel._chosen.key == key
