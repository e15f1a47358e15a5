"""Gaussian splats: the record that all file formats become, and nerfnav's own file of it.

A splat is a soft ellipsoid: seen from anywhere, a ray through its centre m loses the share `opacity` of its light,
and a ray that passes at a distance loses opacity exp(-d^2 / 2), d the distance in the picture in standard deviations
of the projected covariance (Kerbl et al., "3D Gaussian Splatting", SIGGRAPH 2023).

File formats store unit quaternions without their largest part ("smallest three"): the three others lie within
1 / sqrt(2) of zero.
"""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float, Int

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.files import open_npz, write_npz
from nerfnav.geometry import so3
from nerfnav.importers.core.kinds import OWN_SPLATS

_Y0 = 0.5 / np.sqrt(np.pi)
_THINNEST = 1e-6
"""Least variance of a splat, relative to its largest: single precision rounds by less, so none gets negative."""
_CORE = (0.01, 0.99)
"""Quantiles between which nearly everything is."""
_SLAB = 0.1
"""Share of an edge that is cut off at once where hardly anything is in it."""
_HARDLY = 0.002
"""Largest share of the total in such a slab: a fiftieth of a uniform distribution."""
_LARGEST = 0.5
"""Splats whose standard deviation exceeds this share of where nearly all splats are, are backdrops or mistakes."""


@dataclass(frozen=True)
class Splats:
    """Gaussian splats: n soft ellipsoids."""

    centers: Float[np.ndarray, "n 3"]
    """Centres [m]."""
    covariances: Float[np.ndarray, "n 3 3"]
    """Covariances [m^2]."""
    rgbs: Float[np.ndarray, "n 3"]
    """Colours in [0, 1]; the mean over all directions where the file has colours that depend on them."""
    opacities: Float[np.ndarray, "n"]
    """Shares of the light that they stop at their centres, 0 to 1."""
    declared: int = 0
    """Number of splats that the file declares."""
    dropped: dict[str, int] = field(default_factory=dict)
    """Number of dropped splats by reason."""

    def __len__(self) -> int:
        """Number of splats."""
        return len(self.centers)

    def to_world(self, R_world_source: Float[np.ndarray, "3 3"], scale: float) -> "Splats":
        """The splats of a file in the world's axes, with `scale` metres for a unit of the file."""
        turn = scale * R_world_source
        return replace(
            self,
            centers=(self.centers @ turn.T).astype(np.float32),
            covariances=make_positive(turn @ self.covariances @ turn.T),
        )

    @property
    def masses(self) -> Float[np.ndarray, " n"]:
        """Visible mass of each splat: its opacity times its area, s_1 s_2 of its two larger standard deviations."""
        squares = np.linalg.eigvalsh(self.covariances.astype(np.float64)).clip(0, None)  # ascending
        return self.opacities * np.sqrt(squares[:, 1] * squares[:, 2])


def clean_splats(
    centers: np.ndarray, scales: np.ndarray, wxyzs: np.ndarray, rgbs: np.ndarray, opacities: np.ndarray
) -> Splats:
    """Build splats from a file's columns: standard deviations (n, 3), quaternions (n, 4) of any length.

    Non-finite and absurdly large splats are dropped and counted.
    """
    norms = np.linalg.norm(wxyzs, axis=1)
    finite = np.isfinite(np.concatenate([centers, scales, wxyzs, rgbs, opacities[:, None]], 1)).all(1)
    finite &= (norms > 1e-9) & (scales >= 0).all(1) & (np.abs(centers) < 1e6).all(1)
    reach = _reach(centers[finite])
    large = finite & (scales.max(1, initial=0) > _LARGEST * reach)
    kept = finite & ~large
    scales, wxyzs = scales[kept].astype(np.float64), wxyzs[kept].astype(np.float64)
    rotations = so3.matrix_from_quaternion(torch.from_numpy(wxyzs)).numpy()
    axes = rotations * np.maximum(scales, 1e-7 * (reach if np.isfinite(reach) else 1.0))[:, None, :]
    return Splats(
        centers[kept].astype(np.float32),
        make_positive(axes @ axes.transpose(0, 2, 1)),
        rgbs[kept].clip(0, 1).astype(np.float32),
        opacities[kept].clip(0, 1).astype(np.float32),
        len(centers),
        {"not finite": int((~finite).sum()), "absurdly large": int(large.sum())},
    )


def save_splats(splats: Splats, path: Path) -> Path:
    """Write splats to `path`; an existing file is replaced only once all is written."""
    arrays = {
        "centers": splats.centers,
        "covariances": splats.covariances[:, *np.triu_indices(3)],
        "rgbs": np.rint(255 * splats.rgbs).astype(np.uint8),
        "opacities": np.rint(255 * splats.opacities).astype(np.uint8),
    }
    try:
        write_npz(path, arrays)
    except OSError as error:
        raise InvalidInputError(f"the splats cannot be written to {path}: {error.strerror}") from error
    return path


def load_saved_splats(path: Path) -> Splats:
    """Read a file that `save_splats` wrote. Raises InvalidInputError for anything else."""
    try:
        with open_npz(path) as file:
            centers, upper, rgbs, opacities = (file[name] for name in ("centers", "covariances", "rgbs", "opacities"))
        count = len(centers)
        if (centers.shape, upper.shape, rgbs.shape, opacities.shape) != ((count, 3), (count, 6), (count, 3), (count,)):
            raise ValueError("arrays of wrong shape")
        numbers = centers.dtype.kind + upper.dtype.kind + rgbs.dtype.str + opacities.dtype.str
        if numbers != "ff|u1|u1" or not (np.isfinite(centers).all() and np.isfinite(upper).all()):
            raise ValueError("arrays of wrong types, or not finite")
    except (OSError, ValueError) as error:
        raise InvalidInputError(f"{path} is not a whole file of splats that nerfnav wrote") from error
    covariances = make_positive(upper[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(count, 3, 3))
    share = np.float32(1 / 255)
    return Splats(centers, covariances, rgbs * share, opacities * share, count)


def splats_path(field_file: Path) -> Path:
    """Path of the splats of a field: castle.npz has them in castle.splats.npz."""
    return field_file.with_name(field_file.stem + OWN_SPLATS)


def rgb_of(harmonics: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Mean colours over all directions, 1/2 + Y_0 f_dc with Y_0 = 1 / (2 sqrt(pi)), of the first harmonics f_dc."""
    return 0.5 + _Y0 * harmonics


def make_positive(covariances: Float[np.ndarray, "n 3 3"], least: float = _THINNEST) -> Float[np.ndarray, "n 3 3"]:
    """Positive definite covariances, in single precision: no eigenvalue is below `least` times the largest.

    Rounding makes the smallest one of a flat splat negative, and square roots of it are no numbers.
    """
    covariances = 0.5 * (covariances + covariances.transpose(0, 2, 1)).astype(np.float64)
    squares, axes = np.linalg.eigh(covariances)
    floor = np.maximum(least * squares[:, 2:], np.finfo(np.float32).tiny)
    thin = (squares < floor).any(1)
    raised = axes[thin] * np.maximum(squares, floor)[thin][:, None, :]
    covariances[thin] = raised @ axes[thin].transpose(0, 2, 1)
    return covariances.astype(np.float32)


def fit_half_precision(covariances: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Covariances that stay finite and without negative eigenvalues when they are rounded to half precision.

    Too large ones shrink to its largest number; thin splats get as thick as their rounding is.
    """
    half = np.finfo(np.float16)
    largest = np.maximum(np.diagonal(covariances, axis1=1, axis2=2).max(1), np.finfo(np.float32).tiny)
    shrunk = covariances * np.minimum(1.0, 0.9 * float(half.max) / largest)[:, None, None]
    # entries are rounded by half a step, which is no smaller than that of subnormal numbers
    smallest = float(half.smallest_subnormal)
    thick = make_positive(shrunk, 2 * float(half.eps)) + 2 * smallest * np.eye(3)
    return thick.astype(np.float32)


def robust_extent(
    centers: Float[np.ndarray, "n 3"], masses: Float[np.ndarray, " n"] | None = None
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Lower and upper corner (3) of nearly all points (n, 3), weighted by `masses`, by default 1.

    From the first to the last percentile, without nearly empty ends, and 15 % beyond, but no further than
    there are points: objects stay whole, and strays far away do not count.
    """
    masses = np.ones(len(centers)) if masses is None or not masses.any() else masses
    ends = [_core(centers[:, axis], masses) for axis in range(3)]
    lower, upper = np.array(ends, np.float64).T
    margin = 0.15 * (upper - lower)
    return np.maximum(lower - margin, centers.min(0)), np.minimum(upper + margin, centers.max(0))


def _core(along: np.ndarray, masses: np.ndarray) -> tuple[float, float]:
    """Interval along one axis that holds nearly all of a mass."""
    order = np.argsort(along)
    along, share = along[order], np.cumsum(masses[order]) / masses.sum()

    def held(to: float) -> float:
        """Share of the mass up to a coordinate."""
        index = int(np.searchsorted(along, to, side="right"))
        return float(share[index - 1]) if index else 0.0

    low, high = (float(along[min(np.searchsorted(share, end), len(along) - 1)]) for end in _CORE)
    while low + (slab := _SLAB * (high - low)) > low and high - slab < high:  # until rounding leaves nothing to cut
        if held(low + slab) - held(low) < _HARDLY:
            low += slab
        elif held(high) - held(high - slab) < _HARDLY:
            high -= slab
        else:
            break
    return low, high


def _reach(centers: np.ndarray) -> float:
    if len(centers) == 0:
        return 0.0
    lower, upper = robust_extent(centers)
    reach = float((upper - lower).max())
    return reach if reach > 0 else np.inf  # a single point says nothing about what is large


WXYZ, XYZW = (0, 1, 2, 3), (3, 0, 1, 2)
"""Numbers, 0 to 3, that a file gives to the parts w, x, y, z."""
_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])


def from_smallest_three(
    smaller: Float[np.ndarray, "n 3"], largest: Int[np.ndarray, " n"], order: tuple[int, ...] = WXYZ
) -> Float[np.ndarray, "n 4"]:
    """(w, x, y, z) from the three smaller parts, in the file's order, and the number of the one left out, 0 to 3."""
    parts = np.empty((len(smaller), 4))
    np.put_along_axis(parts, _OTHERS[largest], smaller, 1)
    left = np.sqrt(np.maximum(0, 1 - (smaller.astype(np.float64) ** 2).sum(1)))
    np.put_along_axis(parts, largest[:, None], left[:, None], 1)
    return parts.take(order, axis=1)
