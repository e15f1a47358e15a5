"""Drag a goal: a draggable goal in your own viser page, with a plan that follows it through Stonehenge."""

import threading

import viser

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.field import UnknownSpace, field_mesh, planning_field
from nerfnav.planner import FastPlanner, Route

START, GOAL = (0.39, -0.67, 0.2), (-0.4, 0.55, 0.16)


class DragGoalPage:
    """A page whose gizmo is the goal. One thread plans to the newest goal and skips those in between."""

    def __init__(self, port: int = 8090) -> None:
        """Show the field, the start and the gizmo, and make the first plan."""
        field = planning_field(nerfnav.load_field(scenes.trained_path("stonehenge")), UnknownSpace.OCCUPIED)
        self.planner, self.moved = FastPlanner(field, nerfnav.Quadrotor()), threading.Event()
        self.server = viser.ViserServer(port=port)
        scene = self.server.scene
        scene.add_mesh_trimesh("/field", field_mesh(field, spacing=0.02, level=15.0))
        scene.add_icosphere("/start", 0.03, (16, 185, 129), position=START)
        self.goal = scene.add_transform_controls("/goal", 0.2, disable_rotations=True, position=GOAL)
        self.goal.on_update(lambda _: self.moved.set())
        self.motion = nerfnav.run_steps(self.planner.plan(self.route())).motion
        self.moved.set()

    def route(self) -> Route:
        """Return the problem between the start and the gizmo: 20 steps of 0.1 s."""
        x, y, z = map(float, self.goal.position)
        return Route(nerfnav.RigidState.at_rest(START), nerfnav.RigidState.at_rest((x, y, z)), 20, 0.1)

    def update(self) -> None:
        """Wait for a move, replan from the last plan, and draw the path. A goal in a stone keeps the last plan."""
        self.moved.wait()
        self.moved.clear()  # first: a move after this line gives another update
        try:
            self.motion = nerfnav.run_steps(self.planner.replan_moved_ends(self.motion, self.route())).motion
        except nerfnav.NerfnavError as error:
            print(error)
        self.server.scene.add_spline_catmull_rom("/path", self.motion.states.position.numpy(), color=(70, 84, 255))


if __name__ == "__main__":
    page = DragGoalPage()
    while True:
        page.update()
