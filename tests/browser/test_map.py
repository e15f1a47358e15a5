"""What planners believe of a place can be taken away from its page."""

import zipfile
from collections.abc import Callable

import numpy as np

from nerfnav.field.core.occupancy import Occupancy
from nerfnav.field.proof.occupancy_grid import compute_occupancy_grid
from nerfnav.planner.space.scales import threshold_of
from nerfnav_app.server import App
from tests.browser.tab import Tab
from tests.browser.works import roomy_place, small_work


def test_the_map_of_the_place_is_downloaded_as_voxels_as_a_mesh_and_for_ros(
    serve: Callable[..., App], open_tab: Callable[[App], Tab]
) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.until(lambda: tab.has_node("/field") and app.session.job is None, "the place was not opened")
    tab.choose("occupancy_map.kind", "Voxels (.npz)")
    with np.load(tab.download("occupancy_map.download"), allow_pickle=False) as told:
        believed = compute_occupancy_grid(roomy_place().field, threshold_of(roomy_place().field))
        np.testing.assert_array_equal(told["state"], believed.state)
        np.testing.assert_allclose(told["lower"], believed.lower)
        assert (told["state"] == Occupancy.SOLID).any()
    tab.choose("occupancy_map.kind", "Collision mesh (.glb)")
    assert tab.download("occupancy_map.download").read_bytes().startswith(b"glTF")
    tab.choose("occupancy_map.kind", "Map of ROS (.pgm, .yaml)")
    with zipfile.ZipFile(tab.download("occupancy_map.download")) as packed:
        assert packed.namelist() == ["balls-map.pgm", "balls-map.yaml"]
    tab.until_idle()
    assert app.session.trouble is None
