"""Exports flown again by RotorPy and by Mellinger's controller, in a place so simple that both must manage."""

from dataclasses import replace

import numpy as np
import pytest

from nerfnav.core.steps import run_steps
from nerfnav.experiments.reflight import run, summarize, track_of_crazyflie, track_of_px4
from nerfnav.experiments.study import Study
from nerfnav.export.autopilots import px4
from nerfnav.export.crazyflie import crazyflie
from nerfnav.export.curves import curve_of
from tests.experiments.places import TASKS, column
from tests.export.flights import hover_to_hover


@pytest.mark.slow
def test_exports_are_followed_closely_and_touch_nothing() -> None:
    study = Study(column, TASKS[:1])
    last = run_steps(run(replace(study, beside=(study,))))
    assert {row["vehicle"] for row in last.rows} == {"rotorpy-se3", "crazyflie-mellinger"} and len(last.rows) == 4
    for row in last.rows:
        assert row["clean"] and not row["exported"] and row["max_overlap_m3"] == 0
        assert 0 < row["rms_mm"] < 50 and row["max_mm"] < 100, row
    assert last.summary["rotorpy-se3"]["clean"] == 2
    assert len(last.figures["reflight"]().axes) == 2


def test_tracks_are_read_from_the_files_as_they_were_meant() -> None:
    recording = hover_to_hover()
    curve = curve_of(recording)
    setpoints, polynomials = track_of_px4(px4(recording).content), track_of_crazyflie(crazyflie(recording).content)
    for index in range(0, 100, 7):
        setpoint = setpoints.setpoint(0.02 * index + 0.001)  # held since the last row
        for order, part in enumerate((setpoint.position, setpoint.velocity, setpoint.acceleration)):
            np.testing.assert_allclose(part, curve.at(np.array([0.02 * index]), order)[0, :3], atol=1e-6)
        assert np.cos(setpoint.yaw - curve.at(np.array([0.02 * index]))[0, 3]) == pytest.approx(1)
    for track in (setpoints, polynomials):
        rest = track.setpoint(track.duration + 1)
        np.testing.assert_allclose(rest.position, recording.position[-1], atol=1e-6)
        np.testing.assert_allclose(rest.velocity, 0, atol=1e-9)


def test_the_summary_counts_what_was_refused_as_not_clean() -> None:
    row = {"vehicle": "a", "plan_touched": False, "clean": True, "rms_mm": 3.0, "max_mm": 9.0, "duration_s": 2.0}
    refused = row | {"clean": None, "rms_mm": None, "max_mm": None, "duration_s": None}
    summary = summarize([row, row | {"rms_mm": 4.0}, refused])["a"]
    assert (summary["exports"], summary["refused"], summary["clean"], summary["rms_mm_max"]) == (3, 1, 2, 4.0)
    assert summary["rms_mm"] == pytest.approx(np.sqrt(12.5))
