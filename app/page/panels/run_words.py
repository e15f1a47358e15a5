"""Stored flights in words and numbers, as HTML."""

from typing import Any

from nerfnav_app.page.html import columns, legend, note, table
from nerfnav_app.page.panels.dropdown import label_of
from nerfnav_app.page.theme import OTHER_PLAN, OTHER_TRUTH
from nerfnav_app.storage.run_metadata import StoredRun
from nerfnav_app.text import number


def describe(entry: StoredRun) -> str:
    """What is known of a flight, as HTML."""
    about = entry.metadata
    rows = [
        ("Place", about.place),
        ("Task", about.task or "ends put down by hand"),
        ("Robot", label_of(about.robot)),
        ("Planner, estimator", f"{about.planner}, {'none (open loop)' if about.open_loop else about.estimator}"),
        ("Seed", str(about.seed)),
        ("Took off (UTC)", about.date[:19].replace("T", " ")),
        ("Outcome", entry.outcome),
        ("Time steps", f"{entry.steps}, each {about.dt:g} s"),
    ]
    return table([*rows, *numbers_of(about.metrics)])


def numbers_of(metrics: dict[str, Any]) -> list[tuple[str, str]]:
    """What people compare of a flight's metrics, with units; what is not known is left out."""
    estimation, timing = metrics.get("estimation") or {}, metrics.get("timing_ms") or {}
    known = (
        ("Missed the goal by", metrics.get("final_position_error_m"), 100, "cm"),
        ("Time steps in contact", metrics.get("mesh_collision_steps"), 1, ""),
        ("Position RMSE", estimation.get("position_rmse_m"), 100, "cm"),
        ("Attitude RMSE", estimation.get("rotation_rmse_rad"), 57.2958, "°"),
        ("Squared error against expectation (12 is right)", estimation.get("nees_mean"), 1, ""),
        ("Filter, median", timing.get("filter_p50"), 1, "ms"),
        ("Replanning, median", timing.get("replan_p50"), 1, "ms"),
    )
    return [(name, number(scale * value, unit)) for name, value, scale, unit in known if value is not None]


def comparison(first: str, metrics: dict[str, Any], second: str, others: dict[str, Any]) -> str:
    """The numbers of two flights side by side, as HTML."""
    left, right = dict(numbers_of(metrics)), dict(numbers_of(others))
    names = [name for name, _ in numbers_of(metrics | others)]
    rows = [(name, left.get(name, "–"), right.get(name, "–")) for name in names]
    entries = ((OTHER_TRUTH, "path of the second"), (OTHER_PLAN, "plan of the second"))
    titles = note(f"First: {first}. Second: {second}.")
    return titles + legend(entries) + columns(("", "first", "second"), rows)
