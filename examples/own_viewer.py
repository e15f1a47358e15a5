"""Build a viewer: show the surface of a field in your own viser page, and plan again when a slider moves."""

import argparse
import time

import viser

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.field import field_mesh

START = (0.39, -0.67, 0.2)


def main(port: int, seconds: float | None) -> None:
    """Serve the page until Ctrl-C, or for so many seconds."""
    robot, field = nerfnav.Quadrotor(), nerfnav.load_field(scenes.trained_path("stonehenge"))
    server = viser.ViserServer(port=port)
    server.scene.set_up_direction("+z")
    server.scene.add_mesh_trimesh("/field", field_mesh(field, spacing=0.02, level=15.0))
    height = server.gui.add_slider("Goal's height [m]", min=0.1, max=0.5, step=0.01, initial_value=0.16)
    status = server.gui.add_markdown("")

    def plan_again(_: object = None) -> None:
        """Plan to the goal at the slider's height, and draw the plan."""
        start, goal = nerfnav.RigidState.at_rest(START), nerfnav.RigidState.at_rest((-0.4, 0.55, height.value))
        try:
            result = nerfnav.plan(nerfnav.PlanProblem(field, robot, start, goal))
        except nerfnav.NerfnavError as error:  # the goal is inside a stone
            status.content = str(error)
            return
        status.content = f"{result.outcome.value}, J = {result.cost.total:.1f}"
        points = result.motion.states.position.numpy()
        server.scene.add_spline_catmull_rom("/plan", points=points, color=(70, 84, 255))
        print(f"goal at {height.value:.2f} m: {status.content}")

    height.on_update(plan_again)
    plan_again()
    print(f"your app is at http://localhost:{server.get_port()}")
    begun = time.monotonic()
    try:
        while seconds is None or time.monotonic() - begun < seconds:
            time.sleep(0.1)
    except KeyboardInterrupt:
        pass
    server.stop()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=8090, help="port to listen at, or the next free one")
    parser.add_argument("--seconds", type=float, default=None, help="stop after so long; never by default")
    arguments = parser.parse_args()
    main(arguments.port, arguments.seconds)
