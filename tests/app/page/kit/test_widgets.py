"""Lists of names in the page."""

from dataclasses import replace
from pathlib import Path

import viser

from nerfnav import robots
from nerfnav_app.page.kit.widgets import ChoiceList
from nerfnav_app.state.place import Choice
from nerfnav_app.state.session import Session


def test_the_robot_of_a_file_is_listed_by_its_name_alone_and_can_be_taken_again(
    server: viser.ViserServer, opened: Session, tmp_path: Path
) -> None:
    shown = ChoiceList(server, "robot", robots.names(), "What moves", lambda command: None)
    path = str(tmp_path / "scout.yaml")
    shown.show(replace(opened, choice=Choice(robot=path)))
    assert shown._list.value == "scout" and set(robots.names()) < set(shown._list.options)
    assert not any("/" in option for option in shown._list.options), "visitors need not know where files lie"
    shown.show(opened)
    assert shown._list.value == opened.choice.robot and shown._names["scout"] == path
