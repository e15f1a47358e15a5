"""Old public names and options still work, with a warning that gives the new name."""

import warnings
from importlib import import_module

import pytest

import nerfnav.planner
from nerfnav.core import renamed
from nerfnav.core.renamed import NAMES, replace_old_options


def test_an_old_name_is_the_new_one_with_a_warning_that_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(NAMES, "nerfnav.planner.Layout", "nerfnav.planner.PlanProblem")
    with pytest.warns(DeprecationWarning, match=r"nerfnav\.planner\.PlanProblem"):
        old = nerfnav.planner.Layout  # type: ignore[attr-defined]
    assert old is nerfnav.planner.PlanProblem
    assert "Layout" not in dir(nerfnav.planner)


def test_a_name_that_was_never_there_is_refused() -> None:
    with pytest.raises(AttributeError, match=r"No nerfnav\.planner attribute Layout"):
        _ = nerfnav.planner.Layout  # type: ignore[attr-defined]


def test_new_names_give_no_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert nerfnav.planner.plan_fast


@pytest.mark.parametrize("old", NAMES)
def test_each_entry_leads_from_a_face_that_lost_the_name_to_one_that_has_the_new_name(old: str) -> None:
    face, _, name = old.rpartition(".")
    assert name not in dir(import_module(face))
    with pytest.warns(DeprecationWarning):
        found = getattr(import_module(face), name)
    home, _, new = NAMES[old].rpartition(".")
    assert new in dir(import_module(home))
    assert found is getattr(import_module(home), new)


def test_old_options_become_new_ones_with_their_values() -> None:
    said = ["stonehenge", "--config.plan.seed", "2", "--config.noise.std=0.1", "--dt", "1"]
    words, replaced = replace_old_options(said)
    assert words == ["stonehenge", "--plan.seed", "2", "--noise.std=0.1", "--dt", "1"]
    assert replaced == {"--config.plan.seed": "--plan.seed", "--config.noise.std": "--noise.std"}


def test_whole_options_are_renamed_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(renamed.OPTIONS, "--swift", "--fast")
    assert replace_old_options(["--swift", "--swifter"]) == (["--fast", "--swifter"], {"--swift": "--fast"})
