"""Undo and redo of moves and settings, and numbers that no end can have."""

from dataclasses import replace

import pytest

from nerfnav.field import UnknownSpace
from nerfnav.robots import Motion
from nerfnav_app.page.panels.status.status import status
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.queries.click_landing import ClickLandingQuery
from nerfnav_app.state import actions as m
from nerfnav_app.state.actions import Redo, Undo
from nerfnav_app.state.alignment import Ray
from nerfnav_app.state.plan import AllowTime
from nerfnav_app.state.session import MOST_UNDO_STEPS, Session
from tests.app.sessions import after
from tests.app.sessions import planned as well_planned

THERE, FARTHER = End((0.5, -0.5, 0.4)), End((0.4, -0.5, 0.4))


def dragged(session: Session, *ends: End) -> Session:
    """The session after a hand has moved the goal through some places and let go."""
    moves = [m.MoveEnd(EndRole.GOAL, end, held=True) for end in ends]
    return after(session, *moves, m.MoveEnd(EndRole.GOAL, ends[-1]))


def test_a_drag_is_undone_as_one_step_and_done_again(opened: Session) -> None:
    first = dragged(opened, End((0.3, -0.3, 0.4)), THERE)
    second = dragged(first, FARTHER)
    assert after(second, Undo()).ends == first.ends
    back = after(second, Undo(), Undo())
    assert back.ends == opened.ends and not back.history.past
    assert after(back, Redo(), Redo()).ends == second.ends
    assert after(back, Undo()) is back and after(second, Redo()) is second, "there is nothing to do"


@pytest.mark.parametrize(
    "change",
    [
        m.Adjust(m.Settings.PLAN, "duration_s", 3.5),
        m.Adjust(m.Settings.WEIGHTS, "collision", 5.0),
        m.Adjust(m.Settings.FLIGHT, "seed", 7),
        m.Adjust(m.Settings.VIEW, "clearance", True),
        m.TypeEnd(EndRole.START, THERE),
    ],
)
def test_each_setting_and_typed_end_is_undone(opened: Session, change: m.Command) -> None:
    changed = after(opened, change)
    assert changed != opened
    back = after(changed, Undo())
    for part in ("ends", "choice", "task", "plan_settings", "flight_settings", "view_settings"):
        assert getattr(back, part) == getattr(opened, part)
    assert after(back, Redo()).plan_settings == changed.plan_settings


def test_a_slider_that_moves_on_is_one_step_and_another_setting_is_another(opened: Session) -> None:
    slid = after(opened, *(m.Adjust(m.Settings.VIEW, "opacity", share) for share in (0.9, 0.8, 0.7)))
    other = after(slid, m.Adjust(m.Settings.VIEW, "clip", 0.5))
    assert after(other, Undo()).view_settings == slid.view_settings
    assert after(other, Undo(), Undo()).view_settings == opened.view_settings


def test_a_click_that_puts_an_end_down_is_undone(opened: Session) -> None:
    aimed = after(opened, m.AimEnd(EndRole.GOAL), m.ClickScene(Ray((0.0, 0.0, 1.0), (0.0, 0.0, -1.0))))
    assert aimed.clicked is not None
    landed = after(aimed, m.QueryAnswered(ClickLandingQuery(aimed.clicked), THERE.position))
    assert landed.ends.goal.position == THERE.position
    assert after(landed, Undo()).ends == opened.ends


def test_undo_and_redo_bring_the_plan_of_that_time_back(opened: Session) -> None:
    first = well_planned(opened)
    second = well_planned(dragged(first, THERE))
    back = after(second, Undo())
    assert motion_of(back) is motion_of(first) and not back.plan_is_stale
    assert motion_of(after(back, Redo())) is motion_of(second)
    slow = after(first, AllowTime(9.0))
    assert slow.plan_settings.duration_s == 9.0
    assert after(replace(slow, job=None), Undo()).plan_settings == opened.plan_settings


def test_undo_of_a_change_to_the_view_keeps_the_plan(opened: Session) -> None:
    changed = well_planned(after(well_planned(opened), m.Adjust(m.Settings.VIEW, "clearance", True)))
    assert motion_of(after(changed, Undo())) is motion_of(changed)


def test_a_plan_that_was_not_finished_or_is_of_another_field_is_not_brought_back(opened: Session) -> None:
    planning = after(opened, m.StartPlan())
    moved = well_planned(replace(dragged(planning, THERE), job=None))
    assert moved.history.past[-1].plan is None and after(moved, Undo()).plan_is_stale
    drafted = well_planned(opened)
    assert drafted.plan is not None
    drafted = replace(drafted, plan=replace(drafted.plan, field_made_by="a draft"))
    later = well_planned(dragged(drafted, THERE))
    assert motion_of(after(later, Undo())) is motion_of(later), "the plan in a draft is back"


def test_undo_during_a_flight_leaves_its_plan(opened: Session) -> None:
    moved = well_planned(dragged(well_planned(opened), THERE))
    flying = after(moved, m.StartFlight())
    assert flying.in_flight and motion_of(after(flying, Undo())) is motion_of(moved)


def test_undo_after_a_reset_brings_seed_speed_and_plan_back(opened: Session) -> None:
    changes = (m.Adjust(m.Settings.FLIGHT, "seed", 7), m.Adjust(m.Settings.FLIGHT, "pace", 0.5))
    wanted = well_planned(after(dragged(opened, THERE), *changes))
    reset = after(wanted, m.Reset())
    assert reset.plan is None and reset.flight_settings.seed == 0 and reset.flight_settings.pace != 0.5
    assert reset.ends == opened.ends
    back = after(reset, Undo())
    assert (back.ends, back.flight_settings) == (wanted.ends, wanted.flight_settings)
    assert motion_of(back) is motion_of(wanted) and back.fresh_plan is not None and back.job is None
    unplanned = after(dragged(opened, THERE), m.Reset(), Undo())
    assert unplanned.plan is None, "there was no plan to bring back"


def motion_of(session: Session) -> Motion:
    """The trajectory of a session's plan."""
    assert session.plan is not None and session.plan.latest is not None
    return session.plan.latest.motion


def test_another_robot_is_undone_with_its_ends(opened: Session) -> None:
    moved = dragged(opened, THERE)
    other = after(moved, m.Choose(replace(moved.choice, robot="couch")))
    assert other.place is not None and other.place.robot.name == "couch"
    back = after(other, Undo())
    assert back.place is not None and back.place.robot.name == "quadrotor" and back.ends == moved.ends
    assert not back.seeking


def test_a_new_step_forgets_what_was_undone_and_old_ones_are_forgotten_in_the_end(opened: Session) -> None:
    branch = after(dragged(opened, THERE), Undo(), m.Adjust(m.Settings.FLIGHT, "seed", 1))
    assert not branch.history.future
    many = after(opened, *(m.TypeEnd(EndRole.GOAL, End((0.001 * k, -0.5, 0.4))) for k in range(MOST_UNDO_STEPS + 20)))
    assert len(many.history.past) == MOST_UNDO_STEPS


def test_numbers_outside_of_the_place_are_said_and_stay_until_they_are_put_right(opened: Session) -> None:
    typed = after(opened, m.TypeEnd(EndRole.GOAL, End((5.0, 0.0, 5.0))))
    assert typed.ends == opened.ends and typed.outside == {EndRole.GOAL: End((5.0, 0.0, 5.0))}
    said = status(typed).text
    assert said.startswith("The goal cannot be at 5, 0, 5: ") and "x from -0.93 to 0.93 and z from 0.07 to 0.73" in said
    still = after(typed, m.Adjust(m.Settings.FLIGHT, "seed", 3))
    assert status(still).text == said, "it is forgotten though it is not put right"
    for right in (m.TypeEnd(EndRole.GOAL, THERE), m.MoveEnd(EndRole.GOAL, THERE), m.Reset()):
        assert not after(typed, right).outside
    assert after(typed, m.TypeEnd(EndRole.GOAL, THERE)).ends.goal == THERE


def test_numbers_a_hair_outside_are_meant_to_be_inside(opened: Session) -> None:
    typed = after(opened, m.TypeEnd(EndRole.GOAL, End((0.93, 0.0, 0.4))))
    assert not typed.outside and typed.ends.goal.position[0] == pytest.approx(0.93, abs=0.005)


def test_where_unseen_space_is_free_the_ends_are_looked_at_again_also_after_undo(opened: Session) -> None:
    known = replace(opened, problems=dict.fromkeys(EndRole))
    free = after(known, m.Adjust(m.Settings.PLAN, "unknown", UnknownSpace.FREE))
    assert not free.problems
    assert not after(replace(free, problems=dict.fromkeys(EndRole)), Undo()).problems


def test_an_accepted_risk_that_is_no_share_is_refused(opened: Session) -> None:
    for share in (0.0, -0.1, 1.2):
        refused = after(opened, m.Adjust(m.Settings.PLAN, "max_collision", share))
        assert refused.plan_settings == opened.plan_settings
        assert "above 0 % and at most 100 %" in status(refused).text
    assert after(opened, m.Adjust(m.Settings.PLAN, "max_collision", 0.2)).plan_settings.max_collision == 0.2
