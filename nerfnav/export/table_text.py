"""Tables as text: CSV for spreadsheets, JSON that says what it means, and back."""

import csv
import io
import json
import math

import torch
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.export.tables import Table

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
"""What holds for a whole step, as explicit Euler has it (nerfnav.robots)."""
_HELD_COLUMNS = ("vx", "vy", "vz", "wx", "wy", "wz")
_UNITS = {"t": "s"} | dict.fromkeys("xyz", "m") | dict.fromkeys(("vx", "vy", "vz"), "m/s")
_UNITS |= dict.fromkeys(("qw", "qx", "qy", "qz"), "1") | dict.fromkeys(("wx", "wy", "wz"), "rad/s")
_UNIT_OF_SUFFIX = {"n": "N", "nm": "N m", "mps": "m/s", "mps2": "m/s^2", "radps": "rad/s", "radps2": "rad/s^2"}


def csv_text(table: Table) -> str:
    """One header line, one line for each row; nine digits, which is every bit of a float32.

    The header has the units, and says what holds until the next row: `vx [m/s until the next row]`.
    """
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(_headings(table))
    for row in table.values.tolist():
        writer.writerow(["" if math.isnan(value) else f"{value:.9g}" for value in row])
    return stream.getvalue()


def json_text(table: Table) -> str:
    """One object: format, version, what is known about the table, frames, units, columns, rows."""
    rows = [[None if math.isnan(value) else float(f"{value:.9g}") for value in row] for row in table.values.tolist()]
    head = {"format": FORMAT, "version": VERSION, **table.info, "frames": FRAMES, "held": HELD}
    head |= {"units": {name: _unit(name) for name in table.columns}, "columns": list(table.columns)}
    return json.dumps(head | {"rows": rows}, allow_nan=False) + "\n"


def table_of_csv(text: str) -> Table:
    """Read what `csv_text` wrote; a CSV says nothing but columns, units and numbers, so `info` stays empty."""
    try:
        header, *rows = csv.reader(io.StringIO(text))
        columns = tuple(name.partition(" [")[0] for name in header)
        return Table(columns, _tensor([[float(cell) if cell else math.nan for cell in row] for row in rows]))
    except ValueError as error:
        raise InvalidInputError(f"this is not a CSV table of numbers under one header line: {error}") from error


def table_of_json(text: str) -> Table:
    """Read what `json_text` wrote. Raises InvalidInputError for any other text."""
    try:
        content = json.loads(text)
        if content["format"] != FORMAT or content["version"] != VERSION:
            raise ValueError(f"it says format {content['format']!r}, version {content['version']!r}")
        rows = [[math.nan if value is None else float(value) for value in row] for row in content["rows"]]
        derived = {"format", "version", "frames", "held", "units", "columns", "rows"}
        info = {name: value for name, value in content.items() if name not in derived}
        return Table(tuple(content["columns"]), _tensor(rows), info)
    except (ValueError, KeyError, TypeError) as error:
        raise InvalidInputError(f"this is no {FORMAT} of version {VERSION}: {error}") from error


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
