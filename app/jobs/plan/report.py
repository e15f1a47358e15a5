"""Report of a plan: cost, limits of the robot, collision bound in the field, overlap with the mesh."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from nerfnav.export import csv_text, json_text, motion_table
from nerfnav.field import UnknownSpace
from nerfnav.navigation import ExpectedSigma
from nerfnav.planner import PlanCost, PlanOutcome, PlanResult, Safety, assess_safety
from nerfnav.planner.risk.probability import RESOLUTION
from nerfnav.robots import Motion, limit_uses
from nerfnav_app.places.place import Place
from nerfnav_app.storage.kept_obstacles import keep_obstacles
from nerfnav_app.storage.output_files import json_line, write_text


@dataclass(frozen=True)
class PlanRisk:
    """Risk of a plan: the probability that a flight by it touches something, and what the request says of it."""

    probability: float
    """By sampled flights in the noise of the request (nerfnav/planner/risk/probability.py)."""
    weight: float
    """Cost of a collision by noise in J [J]; 0 for the paper's cost."""
    most: float | None
    """Largest probability that the request accepts; None accepts any."""


def summary_of(
    planned: PlanResult,
    place: Place,
    wall_s: float,
    overlap_m3: float | None,
    risk: PlanRisk,
    expected: ExpectedSigma | None,
) -> dict[str, Any]:
    """Numbers of `plan --json`."""
    motion = planned.motion
    safety = assess_safety(place.field, motion, place.robot.body, movers=place.announced_movers)
    placed = {} if place.obstacles is None else {"obstacles": len(place.obstacles.obstacles)}
    return placed | {
        "outcome": planned.outcome.name.lower(),
        "iterations": planned.iteration + 1,
        "wall_s": wall_s,
        "cost": _cost(planned.cost),
        "collision_probability_bound": safety.bound,
        "collision_probability": risk.probability,
        "expected_sigma": None if expected is None else asdict(expected),
        "mesh_overlap_m3": overlap_m3,
        "max_thrust_n": _max_thrust_n(place, motion),
        "max_body_rate": motion.states.body_rate.norm(dim=-1).max().item(),
        "duration_s": motion.actions.shape[-2] * motion.dt,
        "limits": _limits(place, motion),
        "safety": _safety(safety, planned, risk),
    }


def _cost(cost: PlanCost) -> dict[str, Any]:
    """The terms of J, and of those that were added to Eq. 2 the time that each takes."""
    terms: dict[str, Any] = {"collision": cost.collision, "control": cost.control, "total": cost.total}
    if cost.risk:
        terms["risk"] = cost.risk
    if cost.movers:
        terms["movers"] = cost.movers
    if cost.delay:
        terms["delay"] = cost.delay
    if cost.added:
        terms["added"] = {term.name: {"value": term.value, "ms": term.ms} for term in cost.added}
    return terms


def _limits(place: Place, motion: Motion) -> dict[str, dict[str, Any]]:
    """Use of each of the robot's limits by the motion."""
    return {
        use.name: {
            "least": use.least, "most": use.most, "lower": use.lower, "upper": use.upper, "unit": use.unit,
            "violated": use.violated,
        }
        for use in limit_uses(place.robot, motion)
    }  # fmt: skip


def _safety(safety: Safety, planned: PlanResult, risk: PlanRisk) -> dict[str, Any]:
    """Bound on collisions in the field, and by how much the risk exceeds the limit of the request."""
    numbers: dict[str, Any] = {
        "bound": safety.bound,
        "bound_per_step_max": safety.per_step.max().item(),
        "min_clearance_m": safety.min_clearance_m,
        "worst_step": safety.worst_step,
    }
    if risk.weight:
        numbers["expected_by_noise"] = planned.cost.risk / risk.weight
    if planned.outcome is PlanOutcome.TOO_RISKY and risk.most is not None:
        missed_by = (max(risk.probability, RESOLUTION) if risk.weight else safety.bound) - risk.most
        numbers |= {"missed_by": missed_by} if missed_by > 0 else {}  # else the plan is refused for what it shows
    return numbers


def mesh_overlap_m3(place: Place, motion: Motion) -> float | None:
    """Largest overlap of body and mesh over the poses between the waypoints [m^3]; None without a mesh."""
    if place.scene is None:
        return None
    from nerfnav.world import judge  # slow to import, and people see the place before

    return judge(place.scene, place.robot.body, motion.states).max_overlap_m3


def save(
    folder: Path, motion: Motion, place: Place, summary: dict[str, Any], unknown: UnknownSpace
) -> tuple[Path, ...]:
    """Write a plan's files into `folder`, and the obstacles of its place.

    `unknown` is what its planner took unproven space for.
    """
    table = motion_table(motion, place.robot.action_names, place.robot.name)
    info = {"outcome": summary["outcome"], "place": place.source, "unknown": unknown.value}
    robot = {} if place.robot.file is None else {"robot_file": str(place.robot.file)}
    table = replace(table, info=table.info | info | robot)
    return (
        write_text(folder / "trajectory.csv", csv_text(table)),
        write_text(folder / "trajectory.json", json_text(table)),
        write_text(folder / "plan.json", json_line(summary) + "\n"),
        *keep_obstacles(folder, place),
    )


def _max_thrust_n(place: Place, motion: Motion) -> float | None:
    """The largest total thrust; None for a robot whose actions are not thrusts."""
    if "thrust_n" not in place.robot.action_names:
        return None
    return motion.actions[..., place.robot.action_names.index("thrust_n")].max().item()
