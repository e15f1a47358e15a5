"""nerfnav scenes: list the bundled scenes and their tasks."""

from dataclasses import dataclass

from rich.console import Console
from rich.table import Table

import nerfnav_scenes as scenes
from nerfnav.world import Scene
from nerfnav_app.cli.terminal import Output, show


@dataclass(frozen=True)
class Arguments(Output):
    """List the bundled scenes and their tasks."""


def run(arguments: Arguments) -> None:
    """Print every scene with its box, its tasks and whether a trained field comes with it."""
    found = [scenes.load(name) for name in scenes.names()]
    if arguments.json:
        show("scenes", {"scenes": [_summary(scene) for scene in found]}, as_json=True)
        return
    for scene in found:
        trained = "trained field included" if scenes.trained_path(scene.name).is_file() else "not trained yet"
        table = Table("task", "robot", "start [m]", "goal [m]", "name", box=None, title_justify="left")
        table.title = f"{scene.name}: {scene.title}; {scene.box.describe()}; {trained}"
        for number, task in enumerate(scene.tasks):
            table.add_row(str(number), task.robot, _point(task.start), _point(task.goal), task.name)
        Console().print(table)


def _summary(scene: Scene) -> dict[str, object]:
    return {
        "name": scene.name,
        "title": scene.title,
        "box": {"lower": scene.box.lower.tolist(), "upper": scene.box.upper.tolist()},
        "trained": scenes.trained_path(scene.name).is_file(),
        "tasks": [
            {"name": task.name, "robot": task.robot, "start": task.start, "goal": task.goal} for task in scene.tasks
        ],
    }


def _point(point: tuple[float, float, float]) -> str:
    return " ".join(f"{number:g}" for number in point)
