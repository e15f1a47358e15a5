"""Structure from motion from matches alone: poses, points and lens that nobody gave."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.spatial.distance import pdist
from scipy.spatial.transform import Rotation

from nerfnav.core.steps import run_steps
from nerfnav.importers.sfm import incremental
from nerfnav.importers.sfm.bundle import adjust
from nerfnav.importers.sfm.features import Features, Matches, join_tracks, match_features, pair_frames
from nerfnav.importers.sfm.first_pair import guess_focal, rate_first_pairs
from nerfnav.importers.sfm.incremental import Reconstruction, reconstruct
from nerfnav.importers.sfm.model import Model, Observations, SharedLens

SIZE, POINTS = (640, 480), 500
LENS = SharedLens(520.0, (320.0, 240.0), 0.08, -0.03)


@dataclass(frozen=True)
class Filmed:
    """What frames show of a true model."""

    truth: Model
    features: list[Features]
    matches: list[Matches]


def looking(centers: np.ndarray, targets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """R_camera_world and t_camera_world of cameras that look at points, z up in the world."""
    z = targets - centers
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    x = np.cross(z, [0, 0, 1.0])
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    rotations = np.stack([x, np.cross(z, x), z], 1)
    return rotations, -np.einsum("nij,nj->ni", rotations, centers)


def film(centers: np.ndarray, targets: np.ndarray, wrong: float = 0.0, noise: float = 0.3, seed: int = 0) -> Filmed:
    """Film points around the origin; a share of the matches is wrong."""
    rng = np.random.default_rng(seed)
    truth = Model(*looking(centers, targets), rng.uniform(-1.5, 1.5, (POINTS, 3)), LENS)
    features, shows = [], []
    for frame in range(len(centers)):
        pixels, depth = truth.project(np.full(POINTS, frame), np.arange(POINTS))
        points = np.flatnonzero((depth > 0.3) & (pixels > 0).all(1) & (pixels < SIZE).all(1))
        features.append(Features(pixels[points] + rng.normal(0, noise, (len(points), 2)), np.zeros((len(points), 128))))
        shows.append(points)
    matches = []
    for first, second in pair_frames(len(centers)):
        _, one, other = np.intersect1d(shows[first], shows[second], return_indices=True)
        false = rng.random(len(one)) < wrong
        other[false] = rng.permutation(other[false])
        if len(one) >= 15:
            matches.append(Matches(first, second, np.stack([one, other], 1)))
    return Filmed(truth, features, matches)


def orbit(count: int, arc: float) -> tuple[np.ndarray, np.ndarray]:
    angles = np.linspace(0, arc, count)
    centers = np.stack([4 * np.cos(angles), 4 * np.sin(angles), 0.5 + 0.3 * np.sin(3 * angles)], 1)
    return centers, np.zeros_like(centers)


def posed(filmed: Filmed) -> Reconstruction:
    seen = join_tracks(filmed.features, filmed.matches)
    made = run_steps(reconstruct(seen, filmed.matches, filmed.features, SIZE))
    assert made is not None, "no frame has a pose"
    return made


def furthest(made: Reconstruction, truth: Model) -> float:
    """Largest error of a distance between two cameras, as a share of the largest of these."""
    found, true = pdist(made.model.centers[made.posed]), pdist(truth.centers[made.posed])
    return float(np.abs(found * (found @ true) / (found @ found) - true).max() / true.max())


@pytest.mark.parametrize("wrong", [0.0, 0.01])
def test_frames_around_a_thing_are_posed_and_their_lens_is_found(wrong: float) -> None:
    filmed = film(*orbit(16, 1.8), wrong=wrong)
    made = posed(filmed)
    assert made.posed.all()
    assert furthest(made, filmed.truth) < 0.005
    lens = made.model.lens
    assert lens.focal == pytest.approx(LENS.focal, rel=0.01)
    assert (lens.k1, lens.k2) == pytest.approx((LENS.k1, LENS.k2), abs=0.02)
    worlds = made.model.rotations.mT @ filmed.truth.rotations  # the same turn of the world for each frame
    assert np.rad2deg(Rotation.from_matrix(worlds[0].T @ worlds).magnitude()).max() < 0.3


def test_a_camera_that_walks_ahead_and_looks_aside_is_followed() -> None:
    along = np.linspace(-3, 3, 30)
    centers = np.stack([along, np.full(30, -3.5), 0.2 * np.sin(along)], 1)
    filmed = film(centers, centers + np.stack([0.4 * np.sin(along), np.ones(30), np.zeros(30)], 1))
    made = posed(filmed)
    assert made.posed.sum() >= 28 and furthest(made, filmed.truth) < 0.01


def test_a_camera_that_turns_on_the_spot_has_no_first_pair() -> None:
    angles = np.linspace(0, 0.8, 12)
    centers = np.tile([0.0, -4.0, 0.0], (12, 1))
    filmed = film(centers, centers + np.stack([np.sin(angles), np.cos(angles), np.zeros(12)], 1), noise=0.2)
    assert rate_first_pairs(filmed.matches, filmed.features, LENS) == []
    seen = join_tracks(filmed.features, filmed.matches)
    assert run_steps(reconstruct(seen, filmed.matches, filmed.features, SIZE)) is None


def test_frames_that_show_something_else_have_no_pose() -> None:
    filmed = film(*orbit(20, 2.0))
    strange = film(*orbit(20, 2.0), seed=1)
    features = filmed.features[:14] + strange.features[14:]
    matches = [each for each in filmed.matches if each.second < 14]
    matches += [each for each in strange.matches if each.first >= 14]
    seen = join_tracks(features, matches)
    made = run_steps(reconstruct(seen, matches, features, SIZE))
    assert made is not None and made.posed.tolist() == 14 * [True] + 6 * [False]


@pytest.mark.parametrize("focal", [320.0, 560.0, 1000.0])
def test_the_focal_length_is_guessed_from_pairs(focal: float) -> None:
    filmed = film(*orbit(16, 1.8))
    middle, scale = np.array(SIZE) / 2, focal / LENS.focal
    scaled = [Features(middle + scale * (each.pixels - middle), each.descriptors) for each in filmed.features]
    assert guess_focal(filmed.matches, scaled, SIZE) == pytest.approx(focal, rel=0.35)


def test_a_bundle_is_adjusted_to_the_truth_and_what_is_fixed_stays() -> None:
    filmed, rng = film(*orbit(6, 1.0), noise=0.0), np.random.default_rng(0)
    truth = filmed.truth
    seen = join_tracks(filmed.features, filmed.matches)
    points = np.array([truth.points[each] for each in _true_points(filmed, seen)])
    true = Model(truth.rotations, truth.translations, points, LENS)
    turns = Rotation.from_rotvec(rng.normal(0, 0.01, (6, 3))).as_matrix()
    off = Model(
        turns @ truth.rotations, truth.translations + rng.normal(0, 0.02, (6, 3)),
        points + rng.normal(0, 0.02, points.shape), SharedLens(500.0, LENS.center, 0.05, -0.01),
    )  # fmt: skip
    found = adjust(off, seen, np.ones(6, bool), lens_terms=3, rounds=50)
    assert np.abs(found.project(seen.frame, seen.point)[0] - seen.pixels).max() < 0.05
    assert (found.lens.focal, found.lens.k1) == pytest.approx((LENS.focal, LENS.k1), rel=0.02)
    free = np.arange(6) >= 2
    start = Model(*(np.where(free[(...,) + (None,) * (t.ndim - 1)], o, t) for t, o in (
        (true.rotations, off.rotations), (true.translations, off.translations))), off.points, LENS)  # fmt: skip
    found = adjust(start, seen, free, rounds=50)
    assert np.array_equal(found.rotations[~free], true.rotations[~free]) and found.lens == LENS
    assert np.abs(found.translations - true.translations).max() < 1e-3, "two frames and the lens fix the world"


def _true_points(filmed: Filmed, seen: Observations) -> np.ndarray:
    """The true point of each track: the one that is nearest to its first observation there."""
    true = np.zeros(seen.point[-1] + 1, int)
    for point in range(len(true)):
        first = int(np.searchsorted(seen.point, point))
        pixels, depth = filmed.truth.project(np.full(POINTS, seen.frame[first]), np.arange(POINTS))
        off = np.where(depth > 0, np.linalg.norm(pixels - seen.pixels[first], axis=1), np.inf)
        true[point] = off.argmin()
    return true


def test_a_frame_that_shows_two_features_of_a_track_does_not_count_in_it() -> None:
    features = [Features(np.arange(6.0).reshape(3, 2), np.zeros((3, 128))) for _ in range(3)]
    joined = [Matches(0, 1, np.array([[0, 0], [1, 1]])), Matches(1, 2, np.array([[0, 0], [1, 1]]))]
    seen = join_tracks(features, [*joined, Matches(0, 2, np.array([[2, 0]]))])
    assert seen.frame.tolist() == [1, 2, 0, 1, 2] and seen.point.tolist() == [0, 0, 1, 1, 1]


def test_matches_that_contradict_each_other_make_no_track_and_no_model() -> None:
    filmed = film(*orbit(6, 1.0))
    wrong = [replace(each, pairs=each.pairs * [1, 0]) for each in filmed.matches]
    for matches in ([], wrong):
        seen = join_tracks(filmed.features, matches)
        assert len(seen.frame) == len(seen.point) == len(seen.pixels) == 0
        assert run_steps(reconstruct(seen, matches, filmed.features, SIZE)) is None


def test_frames_that_all_lose_their_poses_are_no_model(monkeypatch: pytest.MonkeyPatch) -> None:
    filmed = film(*orbit(6, 1.0))
    seen = join_tracks(filmed.features, filmed.matches)
    monkeypatch.setattr(incremental, "_LEAST_POINTS", 10 * POINTS)
    assert run_steps(reconstruct(seen, filmed.matches, filmed.features, SIZE)) is None


def test_features_match_where_one_motion_explains_them() -> None:
    rng = np.random.default_rng(0)
    filmed = film(*orbit(2, 0.2), noise=0.2)
    first, second = filmed.features
    descriptors = rng.random((POINTS, 128)).astype(np.float32)
    descriptors /= np.linalg.norm(descriptors, axis=1, keepdims=True)
    own = filmed.matches[0].pairs
    tagged = [Features(each.pixels[own[:, k]], descriptors[: len(own)]) for k, each in enumerate((first, second))]
    found = match_features(*tagged, side=640)
    assert len(found) > 0.95 * len(own) and (found[:, 0] == found[:, 1]).all()
    shuffled = Features(rng.permutation(tagged[1].pixels), tagged[1].descriptors)
    assert len(match_features(tagged[0], shuffled, side=640)) < 0.1 * len(own), "they agree on no motion"
    assert match_features(tagged[0], Features(np.zeros((0, 2)), np.zeros((0, 128))), side=640).shape == (0, 2)
