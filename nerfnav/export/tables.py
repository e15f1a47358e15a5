"""Tables of trajectories: one row for each time, as CSV for spreadsheets and as JSON with its metadata, and back.

Row k holds the position and attitude at time k dt, and the velocity, body rate and action that hold from there to the
next row; the last row has no action, which is an empty cell in CSV and null in JSON. Axes are those of the library:
world ENU (x east, y north, z up), body FLU (x forward, y left, z up), attitude as the quaternion (w, x, y, z) of
R_world_body.
"""

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any

import msgspec
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.navigation import Episode
from nerfnav.robots import POSITION, Motion, RigidState

STATE_COLUMNS = ("x", "y", "z", "vx", "vy", "vz", "qw", "qx", "qy", "qz", "wx", "wy", "wz")


@dataclass(frozen=True)
class Table:
    """Named columns of numbers."""

    columns: tuple[str, ...]
    """Name of each column."""
    values: Float[Tensor, "rows columns"]
    """float64; NaN where a cell has no value."""
    info: dict[str, Any] = field(default_factory=dict)
    """Metadata of the numbers: time step, robot, names of the actions."""

    def with_outcome(self, outcome: Enum | None) -> "Table":
        """Add the outcome to `info`; None: it is not known."""
        return self if outcome is None else replace(self, info=self.info | {"outcome": outcome.name.lower()})

    def column(self, name: str) -> Float[Tensor, " rows"]:
        """The numbers under `name`."""
        return self.values[:, self.columns.index(name)]

    def block(self, names: tuple[str, ...]) -> Float[Tensor, "rows names"]:
        """The numbers under several names, side by side."""
        return torch.stack([self.column(name) for name in names], -1)


def motion_table(motion: Motion, action_names: tuple[str, ...], robot: str = "") -> Table:
    """The table of a motion of N steps: t, the 13 numbers of the state, the actions; N + 1 rows."""
    states, actions = _state_block(motion.states), motion.actions.detach().to("cpu", torch.float64)
    rows = states.shape[0]
    if actions.shape != (rows - 1, len(action_names)):
        raise InvalidInputError(
            f"a motion of {rows} states needs actions of shape ({rows - 1}, {len(action_names)}), "
            f"not {tuple(actions.shape)}"
        )
    time = motion.dt * torch.arange(rows, dtype=torch.float64)
    last = torch.full((1, len(action_names)), math.nan, dtype=torch.float64)
    values = torch.cat([time[:, None], states, torch.cat([actions, last])], -1)
    info = {"robot": robot, "dt": motion.dt, "actions": list(action_names)}
    return Table(("t", *STATE_COLUMNS, *action_names), values, info)


_DEVIATIONS = ("sd_x", "sd_y", "sd_z")
"""Columns of the standard deviation of the position [m]."""


def episode_table(episode: Episode, action_names: tuple[str, ...], robot: str = "") -> Table:
    """Make the table of a flight: the true motion, then the belief beside it.

    Adds belief_x ... belief_wz (mean), sd_x, sd_y, sd_z (standard deviation of the position [m]) and touched (1 where
    the body met the ground truth before this row).
    """
    flown = motion_table(Motion(episode.truth, episode.actions, episode.dt), action_names, robot)
    extra = torch.cat([_state_block(episode.beliefs.mean), _deviations(episode), episode.touched.double()[:, None]], -1)
    names = (*(f"belief_{name}" for name in STATE_COLUMNS), *_DEVIATIONS, "touched")
    return Table(flown.columns + names, torch.cat([flown.values, extra], -1), flown.info).with_outcome(episode.outcome)


def estimate_table(episode: Episode, action_names: tuple[str, ...], robot: str = "") -> Table:
    """Make the table of an estimate: the means of the belief with the actions, and sd_x, sd_y, sd_z [m]."""
    means = motion_table(Motion(episode.beliefs.mean, episode.actions, episode.dt), action_names, robot)
    values = torch.cat([means.values, _deviations(episode)], -1)
    info = means.info | {"subject": "estimate"}
    return Table((*means.columns, *_DEVIATIONS), values, info).with_outcome(episode.outcome)


def _deviations(episode: Episode) -> Float[Tensor, "n 3"]:
    variance = torch.diagonal(episode.beliefs.covariance, dim1=-2, dim2=-1)[..., POSITION]
    return variance.detach().clamp_min(0).sqrt().double()


def _state_block(states: RigidState) -> Float[Tensor, "n 13"]:
    quaternion = _continuous(so3.quaternion_from_matrix(states.rotation.detach().double()))
    parts = [states.position.double(), states.velocity.double(), quaternion, states.body_rate.double()]
    return torch.cat([part.detach().cpu() for part in parts], -1)


def _continuous(quaternions: Float[Tensor, "n 4"]) -> Float[Tensor, "n 4"]:
    """Choose between q and -q so that neighbours are close: readers interpolate between rows."""
    along = (quaternions[1:] * quaternions[:-1]).sum(-1)
    flips = torch.where(along < 0, -torch.ones_like(along), torch.ones_like(along))
    return quaternions * torch.cat([flips.new_ones(1), flips]).cumprod(0)[:, None]


FORMAT, VERSION = "nerfnav trajectory", 1
FRAMES = {
    "world": "ENU: x east, y north, z up",
    "body": "FLU: x forward, y left, z up",
    "attitude": "quaternion (w, x, y, z) of R_world_body",
    "body_rate": "wx, wy, wz in the body's axes",
}
HELD = {
    "velocity": "vx, vy, vz of row k hold from t_k to t_k+1: p_k+1 = p_k + v_k dt; at t_k it is (v_k-1 + v_k) / 2",
    "body_rate": "wx, wy, wz of row k hold from t_k to t_k+1: R_k+1 = R_k Exp(w_k dt)",
    "action": "the action of row k holds from t_k to t_k+1; the last row has none",
}
"""Columns that hold for a whole step, by explicit Euler (nerfnav.robots)."""
_HELD_COLUMNS = ("vx", "vy", "vz", "wx", "wy", "wz")
_UNITS = {"t": "s"} | dict.fromkeys("xyz", "m") | dict.fromkeys(("vx", "vy", "vz"), "m/s")
_UNITS |= dict.fromkeys(("qw", "qx", "qy", "qz"), "1") | dict.fromkeys(("wx", "wy", "wz"), "rad/s")
_UNIT_OF_SUFFIX = {"n": "N", "nm": "N m", "mps": "m/s", "mps2": "m/s^2", "radps": "rad/s", "radps2": "rad/s^2"}


def csv_text(table: Table) -> str:
    """One header line, one line for each row; nine digits, which is every bit of a float32.

    The header has the units, and marks columns that hold until the next row: `vx [m/s until the next row]`.
    """
    cells = (["" if math.isnan(value) else f"{value:.9g}" for value in row] for row in table.values.tolist())
    return csv_lines([_headings(table), *cells])


def csv_lines(rows: Iterable[Sequence[str]]) -> str:
    """Rows of cells as lines of CSV."""
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def json_text(table: Table) -> str:
    """One object: format, version, what is known about the table, frames, units, columns, rows."""
    rows = [[None if math.isnan(value) else float(f"{value:.9g}") for value in row] for row in table.values.tolist()]
    content = {
        "format": FORMAT, "version": VERSION, **table.info, "frames": FRAMES, "held": HELD,
        "units": {name: _unit(name) for name in table.columns}, "columns": list(table.columns), "rows": rows,
    }  # fmt: skip
    return json.dumps(content, allow_nan=False) + "\n"


_LARGEST = 1e6
"""Largest number of a trajectory, in the unit of its column: no robot is so far, so fast or so strong."""
_UNIT_TOLERANCE = 1e-3
"""Tolerance of the norm of a quaternion against 1."""


class _TableFile(msgspec.Struct):
    """File of a table, as far as its reader needs types."""

    format: str
    version: int
    columns: tuple[str, ...]
    rows: list[list[float | None]]
    dt: float
    robot: str = ""
    actions: tuple[str, ...] = ()
    outcome: str | None = None
    place: str | None = None
    unknown: str = ""
    robot_file: str = ""


def table_of_json(text: str) -> Table:
    """Read what `json_text` wrote. Raises InvalidInputError for any other text, which names the row and the column."""
    try:
        content = json.loads(text)
        file = msgspec.convert(content, _TableFile)
        if (file.format, file.version) != (FORMAT, VERSION):
            raise ValueError(f"it says format {file.format!r}, version {file.version!r}")
        _check_file(file)
    except (ValueError, RecursionError) as error:
        raise InvalidInputError(f"this is no {FORMAT} of version {VERSION}: {error}") from error
    derived = {"format", "version", "frames", "held", "units", "columns", "rows"}
    info = {name: value for name, value in content.items() if name not in derived}
    rows = [[math.nan if value is None else value for value in row] for row in file.rows]
    return Table(file.columns, _tensor(rows), info)


def _check_file(file: _TableFile) -> None:
    """Raise ValueError for rows that no motion has."""
    missing = {"t", *STATE_COLUMNS, *file.actions}.difference(file.columns)
    if missing or len(set(file.columns)) < len(file.columns):
        raise ValueError(f"its columns lack {', '.join(sorted(missing)) or 'names of their own'}")
    if not 0 < file.dt < _LARGEST:
        raise ValueError(f"dt is a number of seconds above 0, not {file.dt:g}")
    if len(file.rows) < 2:
        raise ValueError(f"it has {len(file.rows)} rows, and a motion has 2 at least")
    required = {file.columns.index(name): name for name in ("t", *STATE_COLUMNS)}
    last = -math.inf
    for index, row in enumerate(file.rows):
        if len(row) != len(file.columns):
            raise ValueError(f"rows[{index}] has {len(row)} numbers for {len(file.columns)} columns")
        for column, value in enumerate(row):
            if (value is None and column in required) or not abs(value or 0.0) <= _LARGEST:
                raise ValueError(
                    f"{file.columns[column]} in rows[{index}] is {value}, not a number up to {_LARGEST:g}"
                )
        state = {name: row[column] or 0.0 for column, name in required.items()}
        if not state["t"] > last:
            raise ValueError(f"t in rows[{index}] is {state['t']:g}, and the row before has {last:g}")
        if not abs(math.hypot(*(state[name] for name in ("qw", "qx", "qy", "qz"))) - 1) < _UNIT_TOLERANCE:
            raise ValueError(f"qw, qx, qy, qz in rows[{index}] are no unit quaternion")
        last = state["t"]


def _headings(table: Table) -> list[str]:
    held = {*_HELD_COLUMNS, *(f"belief_{name}" for name in _HELD_COLUMNS), *table.info.get("actions", ())}
    tails = [_unit(name).removeprefix("1") + " until the next row" * (name in held) for name in table.columns]
    return [f"{name} [{tail}]" if tail else name for name, tail in zip(table.columns, tails, strict=True)]


def _unit(column: str) -> str:
    name = column.removeprefix("belief_").removeprefix("sd_")
    return _UNITS.get(name) or _UNIT_OF_SUFFIX.get(name.rsplit("_", 1)[-1], "1")


def _tensor(rows: list[list[float]]) -> Tensor:
    table = torch.tensor(rows, dtype=torch.float64)
    if table.dim() != 2:
        raise ValueError("it has no rows")
    return table
