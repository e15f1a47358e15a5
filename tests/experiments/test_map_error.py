"""How far off the filter finds positions: measured in flight, and noted in the bundled fields."""

from dataclasses import replace
from pathlib import Path

import pytest

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.map_error import position_floor
from nerfnav.field import VoxelField, load_field, save_field
from nerfnav_scenes.measure import main


def arena(name: str) -> Arena:
    field = load_field(scenes.trained_path(name))
    assert isinstance(field, VoxelField)
    return Arena(scenes.load(name), field)


@pytest.mark.parametrize("name", scenes.with_fields())
def test_bundled_fields_know_it(name: str) -> None:
    field = arena(name).field
    assert field.info.position_floor_m is not None
    assert 0 < field.info.position_floor_m < 0.1 * field.resolution


@pytest.mark.slow
@pytest.mark.nightly
@pytest.mark.parametrize("assumed", [None, 2e-3])
def test_it_is_the_same_whatever_the_flights_assume(assumed: float | None) -> None:
    place = arena("church")
    known, info = place.field.info.position_floor_m, replace(place.field.info, position_floor_m=assumed)
    assert known is not None
    measured = position_floor(Arena(place.scene, replace(place.field, info=info)), flights=12)
    assert measured == pytest.approx(known, rel=0.35)


def test_too_few_pictures_tell_nothing() -> None:
    with pytest.raises(InvalidInputError, match=r"0 pictures of 0 flights"):
        position_floor(arena("stonehenge"), flights=0)


@pytest.mark.slow
def test_measuring_changes_nothing_else_in_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    field = arena("stonehenge").field
    path = tmp_path / "stonehenge.npz"
    save_field(replace(field, info=replace(field.info, position_floor_m=None)), path)
    monkeypatch.setattr(scenes, "trained_path", lambda name: path)
    monkeypatch.setattr("nerfnav_scenes.measure.position_floor", lambda arena: 0.003)
    main(["stonehenge"])
    now = load_field(path)
    assert isinstance(now, VoxelField) and (now.values == field.values).all()
    assert now.info == replace(field.info, position_floor_m=0.003)
