"""Readers of exported files, which only tests need: tables, polynomials of the Crazyflie, and TUM trajectories."""

import csv
import io
import math

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.export.splines import ORDER
from nerfnav.export.tables import STATE_COLUMNS, Table, _tensor
from nerfnav.geometry import so3
from nerfnav.planner import PiecewisePolynomial
from nerfnav.robots import Motion, RigidState


def motion_of_table(table: Table) -> Motion:
    """Convert a table back to a motion; float32. Raises InvalidInputError where columns are missing."""
    names = tuple(table.info.get("actions", ()))
    missing = [name for name in ("t", *STATE_COLUMNS, *names) if name not in table.columns]
    if missing or not names or "dt" not in table.info:
        raise InvalidInputError(
            "a table of a motion needs t, the state's columns, its actions and dt; "
            f"missing: {', '.join(missing) or 'the names of the actions or dt'}"
        )
    states = RigidState(
        table.block(("x", "y", "z")).float(),
        table.block(("vx", "vy", "vz")).float(),
        so3.matrix_from_quaternion(table.block(("qw", "qx", "qy", "qz"))).float(),
        table.block(("wx", "wy", "wz")).float(),
    )
    return Motion(states, table.block(names)[:-1].float(), float(table.info["dt"]))


def table_of_csv(text: str) -> Table:
    """Read CSV that `csv_text` wrote; it has columns, units and numbers alone, so `info` stays empty."""
    try:
        header, *rows = csv.reader(io.StringIO(text))
        columns = tuple(name.partition(" [")[0] for name in header)
        return Table(columns, _tensor([[float(cell) if cell else math.nan for cell in row] for row in rows]))
    except ValueError as error:
        raise InvalidInputError(f"this is not a CSV table of numbers under one header line: {error}") from error


def pieces_of_csv(text: str) -> PiecewisePolynomial:
    """Parse a file that `crazyflie` wrote."""
    _, *rows = csv.reader(io.StringIO(text))
    numbers = np.array(rows, dtype=np.float64)
    spans, powers = numbers[:, 0], numbers[:, 1:].reshape(-1, 4, ORDER + 1)
    shares = np.swapaxes(powers * spans[:, None, None] ** np.arange(ORDER + 1), 1, 2)
    return PiecewisePolynomial(torch.from_numpy(np.append(0.0, spans.cumsum())), torch.from_numpy(shares.copy()))


def poses_of_tum(text: str) -> tuple[Float[Tensor, " rows"], Float[Tensor, "rows 3"], Float[Tensor, "rows 4"]]:
    """Times [s], positions [m] and quaternions (w, x, y, z) of a TUM file."""
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    try:
        numbers = torch.from_numpy(np.array(rows, dtype=np.float64).reshape(len(rows), 8))
    except ValueError as error:
        raise InvalidInputError(f"a TUM file has eight numbers in each line: {error}") from error
    return numbers[:, 0], numbers[:, 1:4], numbers[:, [7, 4, 5, 6]]
