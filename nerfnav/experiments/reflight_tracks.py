"""Tracks read from exported files, as those who get them read them: with NumPy, and with nothing of ours."""

import io

import numpy as np

from nerfnav.experiments.reflight_vehicles import Track, Wish


def track_of_px4(content: bytes) -> Track:
    """Setpoints of a file of the format px4; each row is held until the next comes."""
    rows = np.genfromtxt(io.BytesIO(content), delimiter=",", skip_header=2)
    seconds = 1e-6 * rows[:, 0]
    position, velocity, acceleration = (_enu(rows[:, first : first + 3]) for first in (1, 4, 7))
    yaw, yaw_rate = np.pi / 2 - rows[:, 13], -rows[:, 14]

    def wish(time: float) -> Wish:
        row = max(0, int(np.searchsorted(seconds, time + 1e-9, side="right")) - 1)
        return Wish(position[row], velocity[row], acceleration[row], float(yaw[row]), float(yaw_rate[row]))

    return Track(wish, float(seconds[-1]))


def track_of_crazyflie(content: bytes) -> Track:
    """Polynomials of a file of the format crazyflie, evaluated piece by piece."""
    rows = np.loadtxt(io.BytesIO(content), delimiter=",", skiprows=1, usecols=range(33))
    ends = rows[:, 0].cumsum()
    derivatives = [[np.polynomial.Polynomial(row[1:].reshape(4, 8)[axis]) for axis in range(4)] for row in rows]
    orders = [[[one.deriv(order) for one in piece] for piece in derivatives] for order in (1, 2)]

    def wish(time: float) -> Wish:
        held = min(time, ends[-1])
        piece = min(int(np.searchsorted(ends, held)), len(rows) - 1)
        local = held - ends[piece] + rows[piece, 0]
        value, first, second = (np.array([one(local) for one in part[piece]]) for part in (derivatives, *orders))
        moving = float(time <= ends[-1])
        return Wish(value[:3], moving * first[:3], moving * second[:3], float(value[3]), moving * float(first[3]))

    return Track(wish, float(ends[-1]))


def _enu(ned: np.ndarray) -> np.ndarray:
    return ned[:, [1, 0, 2]] * [1, 1, -1]
