"""How far off the positions are that pictures tell, beyond what each picture says of its own errors.

A field puts its surfaces a little beside their places, by no share of the distance of its nodes that would be the same
for all fields. Where the truth is known, that shows: the errors of positions that were found are

    e_i ~ N(0, C_i + f^2 I)

with C_i what the filter says without f, and f is the likeliest (random effects, see also pose_error.py).
"""

import numpy as np
import scipy
from jaxtyping import Float


def likeliest_floor(errors: Float[np.ndarray, "n 3"], told: Float[np.ndarray, "n 3 3"]) -> float:
    """f [m], for errors [m] of which the filter says C_i [m^2]; 0 where that explains them all."""
    variances, axes = np.linalg.eigh(told)
    along = np.einsum("nij,ni->nj", axes, errors)  # in the axes of C_i, where C_i + f^2 I is diagonal

    def unlikelihood(floor: float) -> float:
        more = variances + floor**2
        return float((np.log(more) + along**2 / more).sum())

    bounds = (0.0, float(np.abs(along).max()))
    found = scipy.optimize.minimize_scalar(unlikelihood, bounds=bounds, method="bounded", options={"xatol": 1e-7})
    return float(found.x) if found.fun < unlikelihood(0.0) else 0.0
