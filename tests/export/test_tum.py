"""What evaluation tools read is what was flown and believed."""

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.formats import FORMATS
from nerfnav.export.recording import Subject
from nerfnav.export.tum import tum
from nerfnav.geometry import so3
from tests.export.flights import flight, flown, plan
from tests.export.readers import poses_of_tum


def test_the_true_poses_read_back_with_the_quaternion_last_and_its_scalar_at_the_end() -> None:
    recording, steps = flight(), flown()
    times, positions, quaternions = poses_of_tum(tum(recording).content.decode())
    np.testing.assert_allclose(times, recording.times, atol=1e-6)
    np.testing.assert_allclose(positions, torch.stack([step.truth.position for step in steps]), atol=1e-6)
    rotations = torch.stack([step.truth.rotation for step in steps]).double()
    np.testing.assert_allclose(so3.matrix_from_quaternion(quaternions), rotations, atol=1e-6)
    line = tum(recording).content.decode().splitlines()[2].split()
    assert float(line[-1]) == pytest.approx(float(quaternions[0, 0]), abs=1e-8)


def test_the_estimate_is_what_was_believed() -> None:
    _, positions, quaternions = poses_of_tum(tum(flight(subject=Subject.ESTIMATE)).content.decode())
    means = [step.belief.mean for step in flown()]
    np.testing.assert_allclose(positions, torch.stack([mean.position for mean in means]), atol=1e-6)
    rotations = torch.stack([mean.rotation for mean in means]).double()
    np.testing.assert_allclose(so3.matrix_from_quaternion(quaternions), rotations, atol=1e-6)


def test_a_plan_has_no_estimate() -> None:
    with pytest.raises(InvalidInputError, match="tum-estimate needs the estimate, and a plan has none: fly it"):
        FORMATS["tum-estimate"].exported(plan())


def test_what_is_no_tum_file_is_refused() -> None:
    with pytest.raises(InvalidInputError, match="eight numbers"):
        poses_of_tum("1 2 3\n")
