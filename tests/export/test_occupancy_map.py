"""Maps as other programs read them: numpy, trimesh, and what map_server does with a picture and its YAML."""

import io

import cv2
import numpy as np
import pytest
import trimesh
import yaml

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.export.occupancy_map import ENDINGS, map_files
from nerfnav.field.core.occupancy import Occupancy
from nerfnav.field.proof.occupancy_grid import OccupancyGrid

FREE, SOLID, UNPROVEN = Occupancy


@pytest.fixture(scope="module")
def grid() -> OccupancyGrid:
    """Voxels of 10 cm: a block, an unproven one, and one solid voxel in the south-western corner."""
    state = np.zeros((20, 15, 8), np.uint8)
    state[4:8, 3:9, 2:6] = SOLID
    state[12:16, 3:9, 2:6] = UNPROVEN
    state[0, 0, 3] = SOLID
    return OccupancyGrid(state, np.array([-1.0, 2.0, 0.5]), 0.1)


def test_numpy_reads_the_voxels(grid: OccupancyGrid):
    (content,) = map_files(grid, ".npz", "place").values()
    with np.load(io.BytesIO(content), allow_pickle=False) as read:
        assert set(read) == {"state", "lower", "voxel"}
        assert read["state"].dtype == np.uint8 and np.array_equal(read["state"], grid.state)
        assert read["lower"].shape == (3,) and np.array_equal(read["lower"], grid.lower)
        assert read["voxel"].shape == () and float(read["voxel"]) == 0.1


def test_trimesh_reads_closed_meshes_around_what_is_solid_and_what_is_unproven(grid: OccupancyGrid):
    (content,) = map_files(grid, ".glb", "place").values()
    scene = trimesh.load(io.BytesIO(content), file_type="glb")
    assert set(scene.geometry) == {"solid", "unproven"}
    for name, volume in [("solid", 4 * 6 * 4 + 1), ("unproven", 4 * 6 * 4)]:
        mesh = scene.geometry[name]
        assert mesh.is_watertight
        assert 0.75 * volume < mesh.volume / 0.1**3 <= volume  # edges and corners are cut
    solid, unproven = scene.geometry["solid"], scene.geometry["unproven"]
    assert np.allclose(unproven.bounds, [[0.2, 2.3, 0.7], [0.6, 2.9, 1.1]], atol=1e-5)
    points = np.array([[-0.4, 2.6, 0.9], [0.4, 2.6, 0.9], [0.0, 2.6, 0.9], [-0.95, 2.05, 0.85], [-0.4, 2.6, 1.2]])
    assert solid.contains(points).tolist() == [True, False, False, True, False]
    assert unproven.contains(points).tolist() == [False, True, False, False, False]


def test_in_the_gltf_up_is_y_as_its_standard_wants(grid: OccupancyGrid):
    (content,) = map_files(grid, ".glb", "place").values()
    whole = trimesh.load(io.BytesIO(content), file_type="glb").to_mesh()
    low, high = whole.bounds
    assert [low[1], high[1]] == pytest.approx([0.7, 1.1], abs=1e-5)  # our z
    assert [low[2], high[2]] == pytest.approx([-2.9, -2.0], abs=0.06)  # our -y


def test_a_place_where_all_is_free_is_an_empty_gltf(grid: OccupancyGrid):
    (content,) = map_files(OccupancyGrid(np.zeros((3, 3, 3), np.uint8), grid.lower, 0.1), ".glb", "place").values()
    assert not trimesh.load(io.BytesIO(content), file_type="glb").geometry


def served(files: dict[str, bytes], name: str) -> tuple[np.ndarray, dict]:
    """Cells (row 0 lowest) as map_server has them: 100 occupied, 0 free, -1 unknown; and its settings."""
    settings = yaml.safe_load(files[name])
    picture = cv2.imdecode(np.frombuffer(files[settings["image"]], np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture.ndim == 2 and settings["negate"] == 0
    occupied = (255 - picture.astype(float)) / 255
    cells = np.full(picture.shape, -1)
    cells[occupied > settings["occupied_thresh"]] = 100
    cells[occupied < settings["free_thresh"]] = 0
    return cells[::-1], settings


def test_ros_reads_a_layer_with_the_right_side_up(grid: OccupancyGrid):
    for ending in (".pgm", ".yaml"):
        files = map_files(grid, ending, "place", height=0.85)
        assert set(files) == {"place.pgm", "place.yaml"}
        cells, settings = served(files, "place.yaml")
        assert settings["resolution"] == 0.1 and settings["origin"] == [-1.0, 2.0, 0.0]

        def cell(x: float, y: float, cells: np.ndarray = cells, settings: dict = settings) -> int:
            column, row = ((np.array([x, y]) - settings["origin"][:2]) / settings["resolution"]).astype(int)
            return cells[row, column]

        assert [cell(-0.4, 2.6), cell(0.4, 2.6), cell(0.0, 2.6)] == [100, -1, 0]
        assert [cell(-0.95, 2.05), cell(-0.95, 3.45), cell(0.95, 2.05)] == [100, 0, 0]
        assert cells.shape == (15, 20)


def test_a_name_may_be_anything_that_a_file_can_be_called(grid: OccupancyGrid):
    cells, settings = served(map_files(grid, ".pgm", 'my: "flat" # é'), 'my: "flat" # é.yaml')
    assert settings["image"] == 'my: "flat" # é.pgm' and cells.shape == (15, 20)


def test_pictures_have_the_shades_that_ros_uses_and_the_middle_layer_is_the_default(grid: OccupancyGrid):
    files = map_files(grid, ".pgm", "place")
    picture = cv2.imdecode(np.frombuffer(files["place.pgm"], np.uint8), cv2.IMREAD_UNCHANGED)
    assert set(np.unique(picture)) == {0, 205, 254}
    assert picture[-1, 0] == 254, "the corner's voxel is one layer lower"
    assert np.array_equal(picture == 0, (grid.state[..., 4] == SOLID).T[::-1])


def test_unknown_endings_and_heights_that_make_no_sense_are_refused(grid: OccupancyGrid):
    with pytest.raises(UnknownNameError, match=r"'.ply'; known are: .glb, .npz, .pgm, .yaml"):
        map_files(grid, ".ply", "place")
    with pytest.raises(InvalidInputError, match="no slice at 9 m"):
        map_files(grid, ".pgm", "place", height=9.0)
    for ending in ENDINGS:
        if ending not in (".pgm", ".yaml"):
            with pytest.raises(InvalidInputError, match=r"a height is for .pgm and .yaml alone"):
                map_files(grid, ending, "place", height=0.9)
