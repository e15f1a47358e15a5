"""Comparisons of the paper beside the numbers of its experiments here, as a page in Markdown.

The paper prints times. Of its other experiments the page repeats the comparison, with the same baselines in this code,
and says where nerfnav is worse. The first line of each experiment makes a short table, which README.md repeats.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from nerfnav.experiments import Row
from nerfnav_app.benchmarks.timing import PAPER_MACHINE
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS
from nerfnav_app.jobs.measure.experiment import Measured
from nerfnav_app.jobs.measure.manifest import Manifest
from nerfnav_app.jobs.measure.results import cell_text, table_of, tables_of


@dataclass(frozen=True)
class Claim:
    """Claim of a comparison, with the numbers of this run; or a number with which there is nothing to compare."""

    text: str
    """Claim, or name of the number."""
    paper: str | None
    """Number that the paper prints, or what it compares with; None: nothing."""
    here: str
    """Number here."""
    holds: bool | None = None
    """It holds here; None where nothing is compared."""

    def row(self) -> Row:
        """Line of the page's table."""
        return {"claim": self.text, "paper, or baseline": self.paper, "here": self.here, "holds": self.holds}


def claims_of(name: str, summary: Row) -> list[Claim]:
    """List the comparisons of an experiment, the most important one first."""
    return list(_CLAIMS[name](summary)) if name in _CLAIMS else []


def write_page(manifest: Manifest, found: Mapping[str, Any]) -> str:
    """Write the page on all experiments: Measured, or a reason, by name."""
    measured = {name: result for name, result in found.items() if isinstance(result, Measured)}
    claims = [(name, claim) for name, result in measured.items() for claim in claims_of(name, result.summary)]
    first = dict(reversed(claims))
    parts = ["# Results", _introduction(manifest)]
    if short := [_in_short(name, measured[name], first[name]) for name in measured if name in first]:
        parts.append(table_of(short))
    if rows := [{"experiment": name} | claim.row() for name, claim in claims if claim.holds is not None]:
        about = (
            f"Times in seconds are printed in the paper, for an {PAPER_MACHINE}. Its other comparisons are repeated "
            "with the baselines of this code."
        )
        parts += ["## Beside the paper and other planners", about, table_of(rows)]
    worse = [f'- {name}: "{claim.text}" does not hold: {claim.here} here, {claim.paper} there.'
             for name, claim in claims if claim.holds is False]  # fmt: skip
    parts += ["## Where nerfnav is worse", "\n".join(worse) or "Nowhere in these comparisons."]
    parts += ["## Trials", _COST, table_of([_counts(name, result) for name, result in found.items()])]
    for name, result in measured.items():
        purpose = EXPERIMENTS[name].purpose
        parts += [f"## {name}", f"{purpose[0].upper()}{purpose[1:]}.", *_deeper(tables_of(result.summary))]
    return "\n\n".join(parts) + "\n"


def _in_short(name: str, result: Measured, claim: Claim) -> Row:
    """Line of the short table."""
    return {"experiment": name, "trials": len(result.ends)} | claim.row()


def _introduction(manifest: Manifest) -> str:
    machine, quick = manifest.machine, " --quick" if manifest.settings.get("quick") else ""
    commit = f", commit {manifest.commit}" if manifest.commit else ""
    return (
        f"Written by `nerfnav experiment all{quick}`: version {manifest.version}{commit}, code {manifest.code[:12]}, "
        f"seed {manifest.settings['seed']}. Machine: {machine['processor']}, {machine['cores']} cores, "
        f"Python {machine['python']}, torch {machine['torch']}, {machine['system']}."
    )


def _counts(name: str, result: Measured | str) -> Row:
    if isinstance(result, str):
        nothing = dict.fromkeys(("trials", "failed", "seeds", "CPU s a trial", _SCALE))
        return {"experiment": name, **nothing, "not run": result}
    seeds = [end.seed for end in result.ends]
    cpu = sum(end.cpu_s for end in result.ends) / max(1, len(result.ends))
    return {
        "experiment": name, "trials": len(seeds), "failed": result.failed,
        "seeds": f"{min(seeds)} to {max(seeds)}" if seeds else None, "CPU s a trial": cpu,
        _SCALE: cpu * 10_000 / 100 / 60, "not run": "",
    }  # fmt: skip


_COST = (
    "CPU time is that of the trials, beside whatever else the machine did. Each process of a cluster adds about 4 s "
    "once, to import and to load compiled code."
)
_SCALE = "10,000 trials on 100 cores [min]"


def _deeper(parts: list[str]) -> list[str]:
    """Headings a level lower."""
    return [f"#{part}" if part.startswith("#") else part for part in parts]


def _timing(summary: Row) -> Iterator[Claim]:
    names = {"plan": "a plan", "replan": "replanning", "filter": "a filter update", "hessian": "its covariance"}
    for name, row in summary["rows"].items():
        paper, here = row["paper_s"], row["nerfnav_ms"]
        yield Claim(f"Less time for {names[name]}", f"{paper:g} s", f"{here:.3g} ms", here < 1e3 * paper)


def _planners(summary: Row) -> Iterator[Claim]:
    own = summary["nerfnav"]
    for baseline in ("minsnap", "rrt"):
        if (other := summary.get(baseline)) is None:
            continue
        for name, what in _COSTS.items():
            yield _less(f"Lower {what} than {baseline}", own[name], other[name])
        yield _less(f"No more failures than {baseline}", own["failures"], other["failures"], or_equal=True)


_COSTS = {
    "collision_mean": "mean collision cost",
    "collision_median": "median collision cost",
    "effort_mean": "mean control effort",
}


def _replanning(summary: Row) -> Iterator[Claim]:
    closed, blind = (summary["together"][loop] for loop in ("closed", "open"))
    shares = [loop["reached"] / max(1, loop["trials"]) for loop in (closed, blind)]
    yield Claim(
        "More flights reach the goal in closed loop than in open loop", f"{shares[1]:.0%}", f"{shares[0]:.0%}",
        shares[0] > shares[1],
    )  # fmt: skip
    yield _less("Fewer flights touch something in closed loop than in open loop", closed["collided"], blind["collided"])


def _flights(summary: Row) -> Iterator[Claim]:
    yield Claim("Flights by camera that reach the goal", None, f"{summary['reached']} of {summary['trials']}")


def _rivals(summary: Row) -> Iterator[Claim]:
    others = _records_with("clean", summary["methods"])
    own = others.pop("nerfnav")
    for name, other in others.items():
        theirs, here = (f"{row['clean']} of {row['trials']}" for row in (other, own))
        yield Claim(f"No fewer clean flights than {name}", theirs, here, own["clean"] >= other["clean"])
    for measure, what in (("time_p50_ms", "time of a plan [ms]"), ("J_median", "J")):
        for name, other in others.items():
            if own[measure] is not None and other[measure] is not None:
                yield _less(f"Lower {what} than {name}", own[measure], other[measure])


def _moving(summary: Row) -> Iterator[Claim]:
    others = {name: row for name, row in summary["methods"].items() if "skipped" not in row}
    own = others.pop("announced")
    for level in reversed([level for level in own if isinstance(own[level], dict)]):
        for name, other in others.items():
            theirs, here = (f"{row[level]['successes']} of {row[level]['worlds']}" for row in (other, own))
            holds = own[level]["successes"] >= other[level]["successes"]
            yield Claim(f"No fewer successes than {name} in {level} worlds", theirs, here, holds)


def _crossing(summary: Row) -> Iterator[Claim]:
    found = summary["together"]
    for knows, what in (("announced", "is announced"), ("seen_in_view", "is seen alone, in view")):
        for pace, own in found[knows].items():
            blind = found["unaware"][pace]
            if own["trials"] and blind["trials"]:
                shares = [row["clean"] / row["trials"] for row in (blind, own)]
                theirs, here = (f"{row['clean']} of {row['trials']}" for row in (blind, own))
                speed = f"{pace.removeprefix('pace_')} times the robot's speed"
                yield Claim(
                    f"More clean flights where a box at {speed} {what} than where the robot is unaware of it",
                    theirs, here, shares[1] > shares[0],
                )  # fmt: skip


def _relocalisation(summary: Row) -> Iterator[Claim]:
    seen = summary["sighted"]
    found = f"{seen['found_and_right']} of {seen['trials']}, {seen['found_but_wrong']} wrong"
    yield Claim("Cameras found by one picture of the place", None, found)


def _basin(summary: Row) -> Iterator[Claim]:
    starts = _records_with("converged_share", summary)
    shares = [f"{row['converged_share']:.0%}" for row in starts.values()]
    yield Claim(f"Filters led back by one picture from {'; '.join(starts)}", None, ", ".join(shares))


def _reflight(summary: Row) -> Iterator[Claim]:
    flown = _records_with("clean", summary)
    clean = [f"{row['clean']} of {row['exports']}" for row in flown.values()]
    yield Claim(f"Exports flown without contact by {', '.join(flown)}", None, ", ".join(clean))


def _correlation(summary: Row) -> Iterator[Claim]:
    value = summary["spearman_median"]
    yield Claim(
        "Correlated collision loss and true overlap (Spearman, median of plans)", "above 0",
        cell_text(value), value is not None and value > 0,
    )  # fmt: skip


def _ground(summary: Row) -> Iterator[Claim]:
    turning, held = summary["gap_overlap_m3"], summary["gap_overlap_held_m3"]
    if turning is not None and held is not None:
        yield Claim(
            "Passing of a gap by a couch that may turn", f"{held:.3g} m^3 overlap without a turn",
            f"{turning:.3g} m^3 overlap", turning == 0 < held,
        )  # fmt: skip
    if (lateral := summary["wheel_lateral_speed_max_mps"]) is not None:
        yield Claim("Free of sliding on wheels (lateral velocity)", "0 m/s", f"{lateral:.3g} m/s", lateral < _SLIDING)


_SLIDING = 1e-3
"""Lateral velocity from which wheels slide [m/s]."""


def _estimation(summary: Row) -> Iterator[Claim]:
    own, inerf = (summary["methods"][name] for name in ("nerfnav", "inerf"))
    for name, what in (
        ("position_rmse_m", "position [m]"), ("rotation_rmse_rad", "rotation [rad]"),
        ("velocity_rmse_mps", "velocity [m/s]"), ("rate_rmse_radps", "body rate [rad/s]"),
    ):  # fmt: skip
        yield _less(f"Lower error of {what} than iNeRF with dynamics", own[name], inerf[name])


def _tangent(summary: Row) -> Iterator[Claim]:
    for start, methods in summary.items():
        if isinstance(methods, dict) and "recursive" in methods:
            own, single = (methods[name]["final_rotation_rad_median"] for name in ("recursive", "single plane"))
            kind = start.replace("_", " ")
            yield _less(f"Nearer to the attitude by Eq. 8 than in one tangent plane, {kind}", own, single)


def _records_with(measure: str, summary: Row) -> dict[str, Row]:
    """Records of a summary that have a measure; others say what was left out."""
    return {name: row for name, row in summary.items() if isinstance(row, dict) and measure in row}


def _less(text: str, own: float, other: float, or_equal: bool = False) -> Claim:
    return Claim(text, cell_text(other), cell_text(own), own < other or (or_equal and own == other))


_CLAIMS: dict[str, Callable[[Row], Iterator[Claim]]] = {
    "timing": _timing,
    "planners": _planners,
    "replanning": _replanning,
    "collision-correlation": _correlation,
    "ground-robots": _ground,
    "estimation": _estimation,
    "tangent-plane": _tangent,
    "flights": _flights,
    "rivals": _rivals,
    "moving": _moving,
    "crossing": _crossing,
    "relocalisation": _relocalisation,
    "basin": _basin,
    "reflight": _reflight,
}
"""Functions that list the comparisons of each experiment: those of the paper, then others."""
