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
    tab.choose("Export", "Map", "Voxels (.npz)")
    with np.load(tab.download("Download map"), allow_pickle=False) as told:
        believed = compute_occupancy_grid(roomy_place().field, threshold_of(roomy_place().field))
        np.testing.assert_array_equal(told["state"], believed.state)
        np.testing.assert_allclose(told["lower"], believed.lower)
        assert (told["state"] == Occupancy.SOLID).any()
    tab.choose("Export", "Map", "Collision mesh (.glb)")
    assert tab.download("Download map").read_bytes().startswith(b"glTF")
    tab.choose("Export", "Map", "Map of ROS (.pgm, .yaml)")
    with zipfile.ZipFile(tab.download("Download map")) as packed:
        assert packed.namelist() == ["balls-map.pgm", "balls-map.yaml"]
    tab.until_idle()
    assert app.session.trouble is None
