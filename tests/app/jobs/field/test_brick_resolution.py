"""Fields of bricks report the distance of their nodes, as the dense fields that they were made of do."""

from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav_app.jobs.field.report import import_numbers
from tests.field.fields import random_voxels


def test_a_field_of_bricks_reports_the_resolution_of_its_nodes() -> None:
    dense = random_voxels()
    bricks = convert_to_bricks(dense)
    assert bricks.resolution == dense.resolution
    assert import_numbers(bricks)["geometry"]["voxel_m"] == import_numbers(dense)["geometry"]["voxel_m"]
