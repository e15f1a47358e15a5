"""Names that other programs rely on: of options and their choices, of what `--json` prints, of what is registered, of
enums."""

from pathlib import Path
from typing import Any

from tests.golden import product as p

_ENDS = ["--start", "-0.65", "-0.6", "0.4", "--goal", "0.05", "-0.55", "0.5"]
_WITH_PLANNER = ("plan", "fly")
_PLANNERS = ("fast", "minsnap", "rrt", "paper")
POSITIONAL = {
    "serve": [], "open": ["room.npz"], "scenes": [], "train": ["stonehenge"], "import": ["trained"],
    "bake": ["room.npz"], "place": ["room.npz"], "info": ["room.npz"],
    "calibrate": ["room.npz"], "plan": ["stonehenge"], "fly": ["stonehenge"],
    "localize": ["room.npz", "picture.png"], "track": ["room.npz", "video.mp4"], "live": ["room.npz"],
    "export": ["flight"], "map": ["room.npz"], "experiment": ["planners"], "report": ["runs"],
    "bench": [], "doctor": [],
}  # fmt: skip
"""What each subcommand must be told, in its order."""
REQUIRED = {
    "train": ["--out", "out.npz"], "import": ["--out", "out.npz"], "bake": ["--out", "out.npz"],
    "place": ["--out", "out.npz"], "track": ["--out", "out"], "export": ["--format", "csv", "--out", "out.csv"],
    "map": ["--out", "out.npz"],
}  # fmt: skip
"""Options without which a subcommand is refused."""
EXAMPLES = {
    "--sweep": ["seed=1,2"], "--turn": ["0", "0", "90"],
    "--up": ["y"], "--picked": ["0", "0", "0", "1", "0", "0", "2.5"], "--box": ["-1", "-1", "0", "1", "1", "2"],
    "--measure": ["0", "0", "0", "1", "0", "0", "2.5"], "--floor": ["0", "0", "0", "1", "0", "0", "0", "1", "0"],
    "--start": ["-0.65", "-0.6", "0.4"], "--goal": ["0.05", "-0.55", "0.5", "1.5"],
    "--imu-mount": ["0.1", "0.2", "0.3", "0", "0", "0", "1"],
}  # fmt: skip
"""Words for options whose default, nothing, no word says."""


def enums() -> dict[str, dict[str, Any]]:
    """The names of every enum that is written, with their values, in their order."""
    values = {
        kind.__name__: {entry.name: p.REWORDED.get(entry.value, entry.value) for entry in kind} for kind in p.ENUMS
    }
    values["State"] = values["Occupancy"]  # they were two enums of the same names and values
    return {p.ENUM_NAMES.get(name, name): found for name, found in values.items()}


def registered() -> dict[str, list[str]]:
    """Names that options take and files hold: of codecs, formats, planners, estimators, robots, experiments, worlds."""
    return {name: list(names) for name, names in p.registries().items()}


def commands() -> dict[str, list[str]]:
    """Every subcommand, and the words that choose further options of it."""
    return {
        f"{name} --planner {planner}" if planner else name: ["--planner", planner] if planner else []
        for name in p.COMMANDS
        for planner in (_PLANNERS if name in _WITH_PLANNER else ("",))
    }


def options() -> dict[str, dict[str, Any]]:
    """The options of all subcommands."""
    return {title: options_of(title) for title in commands()}


def options_of(title: str) -> dict[str, Any]:
    """The options of a subcommand, by name: the choices of each, and the words that say its default."""
    name, *words = words_with(title, {})
    found = p.options_of(name, words)
    for option, told in found.items():
        if option in EXAMPLES:
            told |= {"default": None, "example": EXAMPLES[option]}
    return found


def words_with(title: str, said: dict[str, Any]) -> list[str]:
    """A command line of a subcommand that says what it must, and the default of all options that are told.

    Flags are left out, for to name one is to change it, and so are options whose default no word says.
    """
    name, must = title.split()[0], REQUIRED.get(title.split()[0], [])
    words = [name, *POSITIONAL[name], *commands()[title], *must]
    for option, told in said.items():
        if told["names"] and not told["flag"] and option not in words and told["default"] is not None:
            words += [option, *told["default"]]
    return words


def keys(value: Any) -> Any:
    """The names in what was printed, nested as they are; lists of records as the names of them all."""
    if isinstance(value, dict):
        return {name: keys(entry) for name, entry in value.items()}
    if isinstance(value, list) and value and isinstance(value[0], dict):
        return [keys({name: entry for record in value for name, entry in record.items()})]
    return None


def commands_with_json(fields: Path, folder: Path) -> dict[str, list[str]]:
    """Command lines whose printed names are golden, in the order in which they can be run."""
    room, plan = str(fields / "room.npz"), str(folder / "plan")
    return {
        "scenes": ["scenes"],
        "doctor": ["doctor"],
        "info of voxels": ["info", room],
        "info of bricks": ["info", str(fields / "bricks.npz")],
        "info of networks": ["info", str(fields / "neural.npz")],
        "plan": ["plan", room, *_ENDS, "--out", plan],
        "plan with risk and a bound": ["plan", room, *_ENDS, "--risk", "20", "--max-collision", "0.5", "--steps", "12"],
        "plan by minsnap": ["plan", room, *_ENDS, "--planner", "minsnap"],
        "fly": ["fly", room, *_ENDS, "--steps", "6", "--open-loop", "--out", str(folder / "flight")],
        "export": ["export", plan, "--format", "csv", "--out", str(folder / "plan.csv")],
        "map": ["map", room, "--out", str(folder / "map.npz")],
    }
