"""Gaussian splats: the record that all file layouts become, and nerfnav's own file of it.

A splat is a soft ellipsoid: seen from anywhere, a ray through its centre m loses the share `opacity` of its light,
and a ray that passes at a distance loses opacity exp(-d^2 / 2), d the distance in the picture in standard deviations
of the projected covariance (Kerbl et al., "3D Gaussian Splatting", SIGGRAPH 2023).
"""

import zipfile
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.errors import InvalidInputError
from nerfnav.files import write_npz
from nerfnav.geometry import so3

SUFFIX = ".splats.npz"
"""Ending of nerfnav's own files of splats, which lie beside the field that was made of them."""
_LARGEST = 0.5
"""Splats whose standard deviation exceeds this share of where nearly all splats are, are backdrops or mistakes."""


@dataclass(frozen=True)
class Splats:
    """n splats."""

    centers: Float[np.ndarray, "n 3"]
    """Where they are [m]."""
    covariances: Float[np.ndarray, "n 3 3"]
    """How far they reach [m^2]."""
    rgbs: Float[np.ndarray, "n 3"]
    """Colours in [0, 1]; the mean over all directions where the file has colours that depend on them."""
    opacities: Float[np.ndarray, "n"]
    """Shares of the light that they stop at their centres, 0 to 1."""
    declared: int = 0
    """How many the file said it holds."""
    dropped: dict[str, int] = field(default_factory=dict)
    """Why splats were left out, and how many for each reason."""

    def __len__(self) -> int:
        """How many splats there are."""
        return len(self.centers)

    def placed(self, R_world_source: Float[np.ndarray, "3 3"], scale: float) -> "Splats":
        """The splats of a file in the world's axes, with `scale` metres for a unit of the file."""
        turn = scale * R_world_source
        return replace(
            self,
            centers=(self.centers @ turn.T).astype(np.float32),
            covariances=(turn @ self.covariances @ turn.T).astype(np.float32),
        )


def cleaned(
    centers: np.ndarray, scales: np.ndarray, wxyzs: np.ndarray, rgbs: np.ndarray, opacities: np.ndarray
) -> Splats:
    """Splats of what a file says: standard deviations (n, 3), quaternions (n, 4) of any length.

    What is not a number and what is absurdly large is left out and counted.
    """
    norms = np.linalg.norm(wxyzs, axis=1)
    finite = np.isfinite(np.concatenate([centers, scales, wxyzs, rgbs, opacities[:, None]], 1)).all(1)
    finite &= (norms > 1e-9) & (scales >= 0).all(1) & (np.abs(centers) < 1e6).all(1)
    reach = _reach(centers[finite])
    large = finite & (scales.max(1, initial=0) > _LARGEST * reach)
    kept = finite & ~large
    scales, wxyzs = scales[kept].astype(np.float64), wxyzs[kept].astype(np.float64)
    rotations = so3.matrix_from_quaternion(torch.from_numpy(wxyzs)).numpy()
    axes = rotations * np.maximum(scales, 1e-7 * reach)[:, None, :]
    return Splats(
        centers[kept].astype(np.float32),
        (axes @ axes.transpose(0, 2, 1)).astype(np.float32),
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


def saved_splats(path: Path) -> Splats:
    """Read a file that `save_splats` wrote. Raises InvalidInputError for anything else."""
    try:
        with np.load(path, allow_pickle=False) as file:
            centers, upper, rgbs, opacities = (file[name] for name in ("centers", "covariances", "rgbs", "opacities"))
        count = len(centers)
        if (centers.shape, upper.shape, rgbs.shape, opacities.shape) != ((count, 3), (count, 6), (count, 3), (count,)):
            raise ValueError("arrays of wrong shape")
    except (OSError, zipfile.BadZipFile, ValueError, KeyError, EOFError) as error:
        raise InvalidInputError(f"{path} is not a whole file of splats that nerfnav wrote") from error
    covariances = upper[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(count, 3, 3)
    share = np.float32(1 / 255)
    return Splats(centers, covariances, rgbs * share, opacities * share, count)


def splats_beside(field_file: Path) -> Path:
    """Where the splats lie that a field was made of: castle.npz has them in castle.splats.npz."""
    return field_file.with_name(field_file.stem + SUFFIX)


def extent(centers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper corner (3) of where nearly all points (n, 3) are.

    From the first to the last percentile and 15 % beyond, but no further than there are points: objects stay whole,
    and strays far away do not count.
    """
    lower, upper = np.quantile(centers, [0.01, 0.99], axis=0)
    margin = 0.15 * (upper - lower)
    return np.maximum(lower - margin, centers.min(0)), np.minimum(upper + margin, centers.max(0))


def _reach(centers: np.ndarray) -> float:
    if len(centers) == 0:
        return 0.0
    lower, upper = extent(centers)
    reach = float((upper - lower).max())
    return reach if reach > 0 else np.inf  # a single point says nothing about what is large
