"""Obstacles panel: place boxes, spheres and cylinders by a click, choose one, name, copy, hide and delete it, draw its
path, and play the motions of all."""

from collections.abc import Callable
from dataclasses import replace

import viser

from nerfnav.obstacles import format_obstacles
from nerfnav_app.page.kit.html import ROW, note, warning
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.queries.placed_obstacles import PlacedObstaclesQuery
from nerfnav_app.state.actions import AimEnd, Command
from nerfnav_app.state.obstacles import (
    SPEED,
    ChangeObstacle,
    ChangePace,
    ChooseMode,
    ChooseObstacle,
    CopyObstacle,
    DeleteObstacle,
    GizmoMode,
    ObstacleKind,
    PathPoint,
    PlacedObstacle,
    PlayMotions,
    RemoveMotion,
    SeparateObstacle,
)
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

_NONE = "(none)"
_HANDLES = {
    GizmoMode.MOVE: "Drag its arrows to move it.",
    GizmoMode.TURN: "Drag its rings to turn it.",
    GizmoMode.SCALE: "Drag its corner to scale it.",
}
_DRAW, _END = "Draw a path", "End path"
_PLAY, _STOP = "Play motions", "Stop motions"
_ICON = viser.Icon


class ObstaclesPanel:
    """Panel of the obstacles: buttons that add them, the list, and what can be done with the chosen one."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._session: Session | None = None
        gui = server.gui
        with gui.add_folder("Obstacles"):
            kinds = tuple(kind.value for kind in ObstacleKind if not kind.selects)
            self._add = gui.add_button_group("Click to add", kinds, hint="Then click into the scene")
            volumes = tuple(kind.value for kind in ObstacleKind if kind.selects)
            self._cut = gui.add_button_group(
                "Cut out", volumes, hint="Click onto the place: a volume there, or around the part, selects it"
            )
            self._status = gui.add_html("")
            self._list: viser.GuiDropdownHandle[str] = gui.add_dropdown("Obstacle", [_NONE], visible=False)
            self._name = gui.add_text("Its name", "", visible=False)
            self._mode = gui.add_button_group(
                "Handles", tuple(mode.value for mode in GizmoMode), visible=False, hint="Keys 1, 2, 3"
            )
            self._draw = gui.add_button(
                _DRAW, icon=_ICON.ROUTE, visible=False, hint="It moves from take-off on: click where it goes, in turn"
            )
            self._speed = gui.add_number("Speed [m/s]", SPEED, step=0.1, visible=False, hint="Along its path")
            self._closed = gui.add_checkbox(
                "Closed", True, visible=False, hint="From its last point it returns to the first, without end"
            )
            self._still = gui.add_button(
                "Remove path", color="gray", icon=_ICON.ROUTE_OFF, visible=False, hint="It stands from now on"
            )
            self._announced = gui.add_checkbox(
                "Announced", True, visible=False, hint="Off: the robot does not know of it, and has to see it"
            )
            self._hidden = gui.add_checkbox("Hide it", False, visible=False, hint="It stays in the list")
            self._separate = gui.add_button(
                "Separate", icon=_ICON.SCISSORS, visible=False,
                hint="Make an obstacle of what is in the volume; what it leaves behind is unproven",
            )  # fmt: skip
            self._play = gui.add_button(
                _PLAY, color="gray", icon=_ICON.PLAYER_PLAY, visible=False,
                hint="Show how obstacles move from take-off on, without a flight",
            )  # fmt: skip
            self._save = gui.add_button(
                "Save obstacles", color="gray", icon=_ICON.DOWNLOAD, visible=False,
                hint="As YAML, for --obstacles of plan, fly and serve",
            )  # fmt: skip
            gui.add_html(ROW)
            self._copy = gui.add_button("Copy", color="gray", visible=False)
            self._delete = gui.add_button("Delete", color="gray", visible=False)
        post_on(self._add.on_click, post, lambda: AimEnd(ObstacleKind(self._add.value)))
        post_on(self._cut.on_click, post, lambda: AimEnd(ObstacleKind(self._cut.value)))
        post_on(
            self._separate.on_click, post, lambda: None if (one := self._chosen) is None else SeparateObstacle(one.name)
        )
        post_on(self._list.on_update, post, self._choose)
        post_on(self._mode.on_click, post, lambda: ChooseMode(GizmoMode(self._mode.value)))
        post_on(self._name.on_update, post, self._rename)
        post_on(self._hidden.on_update, post, self._hide)
        post_on(self._announced.on_update, post, self._announce)
        post_on(self._draw.on_click, post, self._aim)
        post_on(self._speed.on_update, post, self._pace)
        post_on(self._closed.on_update, post, self._pace)
        post_on(self._still.on_click, post, lambda: None if (one := self._chosen) is None else RemoveMotion(one.name))
        post_on(self._play.on_click, post, lambda: PlayMotions(self._play.label == _PLAY))
        post_on(self._copy.on_click, post, lambda: None if (one := self._chosen) is None else CopyObstacle(one.name))
        post_on(
            self._delete.on_click, post, lambda: None if (one := self._chosen) is None else DeleteObstacle(one.name)
        )
        self._save.on_click(self._send)

    @property
    def _chosen(self) -> PlacedObstacle | None:
        return None if self._session is None else self._session.chosen_obstacle

    def _choose(self) -> ChooseObstacle:
        name = str(self._list.value)
        return ChooseObstacle(None if name == _NONE else name)

    def _rename(self) -> ChangeObstacle | None:
        placed = self._chosen
        return None if placed is None else ChangeObstacle(placed.name, placed.changed(name=str(self._name.value)[:100]))

    def _hide(self) -> ChangeObstacle | None:
        placed = self._chosen
        return None if placed is None else ChangeObstacle(placed.name, replace(placed, hidden=bool(self._hidden.value)))

    def _announce(self) -> ChangeObstacle | None:
        placed = self._chosen
        return None if placed is None else ChangeObstacle(placed.name, placed.changed(seen=not self._announced.value))

    def _aim(self) -> AimEnd:
        return AimEnd(PathPoint.NEXT if self._draw.label == _DRAW else None)

    def _pace(self) -> ChangePace | None:
        placed = self._chosen
        return None if placed is None else ChangePace(placed.name, float(self._speed.value), bool(self._closed.value))

    async def _send(self, event: viser.GuiEvent) -> None:
        """Send the file to the tab that requests it."""
        if event.client is not None and self._session is not None:
            text = format_obstacles([placed.entry for placed in _saved(self._session)])
            event.client.send_file_download("obstacles.yaml", text.encode(), save_immediately=True)

    def show(self, session: Session) -> None:
        """Show the list, and the chosen obstacle."""
        self._session = session
        placed, names = session.chosen_obstacle, (_NONE, *(each.name for each in session.obstacles))
        self._add.visible = self._cut.visible = session.place is not None
        self._list.visible = len(names) > 1
        self._save.visible = bool(_saved(session))
        self._separate.visible = placed is not None and placed.selects
        for widget in (self._name, self._mode, self._hidden, self._copy, self._delete):
            widget.visible = placed is not None
        self._announced.visible = placed is not None and not placed.selects and placed.cut_out is None
        self._show_motion(session, placed)
        if self._list.options != names:
            self._list.options = names
        self._list.value = _NONE if placed is None else placed.name
        self._status.content = describe(session)
        if placed is not None:
            self._name.value, self._hidden.value = placed.name, placed.hidden
            self._announced.value = not placed.entry.seen

    def _show_motion(self, session: Session, placed: PlacedObstacle | None) -> None:
        """Show what can be done with the motion of the chosen obstacle, and play or stop all."""
        path = None if placed is None else placed.path
        self._draw.visible = placed is not None and placed.may_have_path
        self._draw.label = _DRAW if session.drawing is None else _END
        self._speed.visible = self._closed.visible = path is not None
        if path is not None:
            self._speed.value, self._closed.value = path.speed, path.closed
        self._still.visible = placed is not None and placed.moves
        self._play.visible = bool(session.movers) and not session.in_flight
        plays = session.motion_time is not None
        if (self._play.label == _STOP) != plays:
            self._play.label = _STOP if plays else _PLAY
            self._play.icon = _ICON.PLAYER_STOP if plays else _ICON.PLAYER_PLAY


def _saved(session: Session) -> tuple[PlacedObstacle, ...]:
    """List what a file holds: all but volumes that only select."""
    return tuple(placed for placed in session.obstacles if not placed.selects)


def describe(session: Session) -> str:
    """Describe what is wrong with obstacles, or what the next click does, as HTML."""
    if session.drawing is not None:
        return note("Click where it goes next; End path or Esc ends.")
    if session.aiming is ObstacleKind.CLICKED_PART:
        return note("Click onto something that stands free.")
    if isinstance(session.aiming, ObstacleKind):
        return note(f"Click into the scene to place the {session.aiming.value}.")
    answered = PlacedObstaclesQuery.result_in(session)
    known = {placed.name for placed in session.visible_obstacles}
    problems = [] if answered is None else [text for name, text in answered.problems.items() if name in known]
    if problems:
        return warning(" ".join(map(sentence, problems)))
    placed = session.chosen_obstacle
    if placed is None:
        return note("Click an obstacle to choose it.") if session.obstacles else ""
    if session.gizmo_mode is GizmoMode.SCALE and placed.half_extents is None:
        return note("This obstacle keeps its size.")
    if placed.selects:
        return note("Move, turn and scale the volume until it holds the part, then separate it.")
    return note(_HANDLES[session.gizmo_mode])
