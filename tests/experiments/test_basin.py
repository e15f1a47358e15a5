"""From how far off a picture leads back."""

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.experiments.basin import SIZES, make_prior, run, summarize
from nerfnav.experiments.study import Study
from nerfnav.robots.state import ATTITUDE, POSITION, RigidState
from tests.experiments.places import TASKS, column

HERE = RigidState.at_rest((0.1, 0.2, 0.3), 0.4)


@pytest.mark.parametrize("size", SIZES)
def test_a_prior_is_off_by_just_as_much_as_it_says(size: tuple[float, float]) -> None:
    belief = make_prior(HERE, size, torch.Generator().manual_seed(1))
    error = belief.mean.local(HERE)
    assert error[POSITION].norm().item() == pytest.approx(size[0], rel=1e-3)
    assert error[ATTITUDE].norm().item() == pytest.approx(size[1], rel=1e-3)
    for part, length in ((POSITION, size[0]), (ATTITUDE, size[1])):
        assert belief.covariance.diagonal()[part].sum().item() == pytest.approx(length**2, rel=1e-3)


def test_unnoticed_failures_are_counted() -> None:
    row = {"error_m": 0.02, "position_m": 0.002, "rotation_deg": 0.1, "converged": True, "outcome": "updated", "ms": 9}
    lost = row | {"converged": False, "outcome": "diverged"}
    wrong = row | {"converged": False, "position_m": 0.05}
    blind = wrong | {"outcome": "predicted_only"}
    assert summarize([row, row, row, lost, wrong, blind])["2 cm, 0.02 rad"] == {
        "trials": 6, "converged_share": 0.5, "saw_nothing": 1, "failed_knowingly": 1, "failed_unknowingly": 1,
        "position_median_m": 0.002, "rotation_median_deg": 0.1, "ms_median": 9.0,
    }  # fmt: skip


@pytest.mark.slow
def test_every_flight_is_corrected_from_every_size() -> None:
    results = run_steps(run(Study(column, TASKS, trials=1)))
    assert [(row["error_m"], row["error_rad"]) for row in results.rows] == list(SIZES)
    assert list(results.summary) == ["2 cm, 0.02 rad", "5 cm, 0.05 rad", "10 cm, 0.1 rad", "20 cm, 0.2 rad"]
    assert list(results.figures) == ["basin"]
