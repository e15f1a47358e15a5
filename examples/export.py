"""Export: write a plan as setpoints for PX4 and as polynomials for a Crazyflie."""

import argparse
from pathlib import Path

import nerfnav
import nerfnav_scenes as scenes


def main(out: Path) -> None:
    """Plan the first task of Stonehenge, and write two files."""
    robot, task = nerfnav.Quadrotor(), scenes.tasks_of("stonehenge")[0]
    field = nerfnav.load_field(scenes.trained_path("stonehenge"))
    result = nerfnav.plan(nerfnav.PlanProblem(field, robot, task.start_state, task.goal_state))
    if result.outcome is not nerfnav.PlanOutcome.CONVERGED:
        raise SystemExit(f"no plan to fly: {result.outcome.value}")
    recording = nerfnav.Recording.of_plan(result.motion, robot, title=task.name)
    out.mkdir(parents=True, exist_ok=True)
    for name in ("px4", "crazyflie"):
        form = nerfnav.FORMATS[name]
        exported = form.make(recording)
        path = out / f"{name}.{form.ending}"
        path.write_bytes(exported.content)
        rows = exported.content.decode().splitlines()
        print(f"{path}: {form.purpose}, {len(rows) - 1} rows, {len(exported.content)} bytes; {exported.info}")
    print(f"duration: {recording.times[-1]:.1f} s; PX4 reads north, east, down in m and m/s, headings in rad")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("runs/export"), help="folder to write into")
    main(parser.parse_args().out)
