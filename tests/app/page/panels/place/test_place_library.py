"""The list of kept places."""

from dataclasses import replace
from pathlib import Path

import viser

from nerfnav_app.page.panels.place.place_library import PlaceLibraryPanel
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.queries.place_list import PlaceListQuery
from nerfnav_app.state.session import Session
from tests.app.places.test_library import brought


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


def test_the_place_that_is_opened_is_selected_until_the_user_selects_another(
    server: viser.ViserServer, opened: Session, tmp_path: Path
) -> None:
    library = PlaceLibrary(tmp_path)
    for name in ("moon", "sun"):
        brought(library, f"{name}.splat", name.encode())
    panel = PlaceLibraryPanel(server, lambda command: None, library)
    for entry in library.entries():
        here = replace(PlaceListQuery((0,)).apply(opened, library.entries()), what=entry.what)
        panel.show(here)
        assert panel._list.value == entry.name
    other = next(name for name in panel._list.options if name != panel._list.value)
    panel._list.value = other
    panel.show(here)
    assert panel._list.value == other
