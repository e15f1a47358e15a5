"""Import rules: levels of the packages and of what is inside them, faces, cycles, and the wall before the truth."""

import ast
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LEVELS = (
    ("core",),
    ("geometry",),
    ("formats",),
    ("world", "field", "robots"),
    ("obstacles",),
    ("importers", "planner", "estimator"),
    ("inertial",),
    ("navigation", "tracking"),
    ("export", "live"),
    ("experiments",),
    ("api",),
)
"""Packages of nerfnav from the ground up. A package imports only from levels below its own, and from itself."""
BESIDE = {("world", "robots")}
"""Exceptions within a level: ground truth judges the bodies of robots."""
WALL = ("planner", "estimator", "navigation", "tracking")
"""Packages that plan and estimate in the field alone: the mesh judges what was planned on the field."""
ROOMS: dict[str, tuple[str, ...]] = {
    "cli": ("server", "live_server", "page", "page_server", "jobs", "storage", "places", "security", "system", "text"),
    "server": ("page", "page_server", "worker", "ui_loop", "state", "places", "security"),
    "kernels_ahead": ("jobs", "places", "system"),
    "live_server": ("security", "system"),
    "ui_loop": ("reducers", "state"),
    "page_server": ("page.kit.theme", "places", "security"),
    "worker": ("queries", "state", "jobs", "storage", "places", "text", "system"),
    "page": (
        "queries", "state", "places", "jobs.events", "storage.run_metadata", "storage.experiment_store",
        "text",
    ),
    "queries": ("reducers", "state", "jobs", "storage", "places", "text"),
    "reducers": ("state", "jobs.events", "places", "text"),
    "state": ("jobs.events", "storage.run_metadata", "places"),
    "jobs": ("benchmarks", "storage", "places"),
    "storage": ("places", "text"),
    "benchmarks": (),
    "places": (),
    "security": (),
    "system": (),
    "text": (),
}  # fmt: skip
"""Packages of app/, the highest first, and what each may import of app/ besides itself."""
INNER_LEVELS: dict[str, tuple[tuple[str, ...], ...]] = {
    "nerfnav.estimator": (
        ("photometric",),
        ("core",),
        ("relocalize",),
        ("consistency", "map_error", "paper"),
        ("gauss_newton",),
        ("calibration", "estimators"),
    ),
    "nerfnav.experiments": (
        ("arena", "field_geometry", "figures", "flight_options"),
        ("closed_loop_flight", "free_space_accuracy", "study"),
        ("correlation", "disturbed_flights", "ground_robots", "map_error", "planners", "relocalisation", "tangent"),
        ("basin", "estimation", "reflight"),
        ("closed_loop",),
        ("replanning",),
        ("rivals",),
        ("moving",),
    ),
    "nerfnav.field": (
        ("core",),
        ("kernels",),
        ("render",),
        ("models",),
        ("edit", "proof", "storage", "surface"),
        ("train",),
    ),
    "nerfnav.importers": (
        ("core",),
        ("sfm",),
        ("alignment", "captures", "nerf"),
        ("splats",),
        ("meshes",),
        ("detect",),
    ),
    "nerfnav.navigation": (
        ("gust", "gyroscopes", "supervisor_state", "watch"),
        ("fallback", "seen_movers", "simulator", "supervisor"),
        ("episode", "flight"),
        ("landing", "watching"),
        ("expected_belief",),
        ("expected_noise", "looking"),
        ("first_plan", "physical", "realtime"),
        ("loop",),
    ),
    "nerfnav.planner": (
        ("kernels", "polynomials", "trajectory", "visibility"),
        ("active_yaw", "moving", "space", "steps"),
        ("risk",),
        ("terms",),
        ("objective",),
        ("solvers",),
        ("baselines",),
        ("planners",),
    ),
    "nerfnav.tracking": (
        ("frame", "photometric_consistency", "tracker_config"),
        ("preintegration", "sources"),
        ("motions",),
        ("tracker",),
        ("camera_check",),
    ),
    "nerfnav_app.cli": (
        ("help", "terminal"),
        ("arguments", "main", "progress"),
        ("commands",),
    ),
    "nerfnav_app.jobs": (
        ("events",),
        ("export", "field", "plan", "subprocess_job", "track"),
        ("fly", "measure"),
        ("open",),
    ),
    "nerfnav_app.page": (
        ("kit",),
        ("layers",),
        ("panels", "splash"),
        ("catalog",),
        ("page",),
    ),
    "nerfnav_app.page.panels": (
        ("flight", "place", "plan", "runs"),
        ("status",),
    ),
}
"""The same inside each package that has sub-packages: its sub-packages and modules from the ground up. Each imports
only from levels below its own, and from itself."""
ONLY_IN = {
    "viser": tuple(f"nerfnav_app.{name}" for name in ("page", "page_server", "security", "cli.commands.serve")),
    "threading": tuple(f"nerfnav_app.{name}" for name in ("worker", "ui_loop", "security", "cli.commands.serve")),
}
"""External modules to the modules of app/ that may import them."""
SIDE_BY_SIDE = ("nerfnav.experiments.study", "nerfnav.importers.sfm.pose_pictures")
"""Modules of the library that may start processes or threads: for trials, and for the frames of a video."""
SETTING_THREADS = tuple(
    f"nerfnav_app.{name}" for name in ("worker", "live_server", "kernels_ahead", "cli.progress", "benchmarks")
)
"""Modules of app/ that may set the number of threads of torch."""
IMPORT_NAMES = {"app": "nerfnav_app", "scenes": "nerfnav_scenes"}
"""Folders to their import names, by links in packaging/: other projects have a folder app/ on their path, too."""
SOURCES = sorted(path for folder in ("nerfnav", "scenes", "app") for path in (ROOT / folder).rglob("*.py"))
LIBRARY = [path for path in SOURCES if path.is_relative_to(ROOT / "nerfnav")]
APP = [path for path in SOURCES if path.is_relative_to(ROOT / "app") and path.name != "__init__.py"]
FACES = sorted((ROOT / "nerfnav").rglob("__init__.pyi"))


def module_of(path: Path) -> str:
    folder, *rest = path.relative_to(ROOT).with_suffix("").parts
    parts = (IMPORT_NAMES.get(folder, folder), *rest)
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(path.read_text())))


@cache
def imported(path: Path) -> set[str]:
    """Return every module that a file imports, anywhere in it, as deep as it can be resolved."""
    modules: set[str] = set()
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the layers"
            base = node.module or ""
            modules |= {f"{base}.{alias.name}" if is_module(f"{base}.{alias.name}") else base for alias in node.names}
    return modules


def path_of(name: str) -> Path:
    """Return the path of a package, or of a module without its suffix."""
    return (ROOT / "packaging" if name.startswith(tuple(IMPORT_NAMES.values())) else ROOT).joinpath(*name.split("."))


@cache
def is_module(name: str) -> bool:
    path = path_of(name)
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def package_of(module: str) -> str | None:
    """Return the package of nerfnav that holds a module; None for modules of others."""
    parts = module.split(".")
    return parts[1] if parts[0] == "nerfnav" and len(parts) > 1 else None


def level_of(package: str) -> int:
    found = [index for index, level in enumerate(LEVELS) if package in level]
    assert found, f"nerfnav.{package} has no level: place it in LEVELS"
    return found[0]


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


def within(module: str, places: tuple[str, ...]) -> bool:
    """Return whether a module is one of these, or in one of these packages."""
    return any(module == place or module.startswith(f"{place}.") for place in places)


def package_path(stub: Path) -> str:
    return ".".join(stub.parent.relative_to(ROOT).parts)


def on_the_face(stub: Path) -> dict[tuple[str, str], str]:
    """Map (module, name) to the package of the face, for each name that a face takes from a module."""
    package = package_path(stub)
    imports = [node for node in ast.parse(stub.read_text()).body if isinstance(node, ast.ImportFrom) and node.module]
    return {(f"{package}.{node.module}", alias.name): package for node in imports for alias in node.names}


def names_on_face(stub: Path) -> set[str]:
    """Return all names that a face gives, modules included."""
    imports = [node for node in ast.parse(stub.read_text()).body if isinstance(node, ast.ImportFrom)]
    return {alias.name for node in imports for alias in node.names}


def units_of(package: str) -> set[str]:
    """Return the names of the modules and sub-packages that stand in a package."""
    paths = path_of(package).iterdir()
    return {path.stem for path in paths if path.suffix == ".py" or (path / "__init__.py").is_file()} - {"__init__"}


def the_library_imports_only_from_lower_levels() -> Iterator[str]:
    for path in LIBRARY:
        own = package_of(module_of(path))
        for module in imported(path):
            if module.split(".")[0] in IMPORT_NAMES.values():
                yield f"{relative(path)} imports {module}"
            other = package_of(module)
            if own is None or other is None or own == other or (own, other) in BESIDE:
                continue
            if not level_of(other) < level_of(own):
                yield f"{relative(path)} imports {module}, which is not below it"


def inside_a_package_imports_point_down_too() -> Iterator[str]:
    for package, levels in INNER_LEVELS.items():
        level = {unit: index for index, units in enumerate(levels) for unit in units}
        yield from (f"{package}.{unit} has no level, or does not exist" for unit in level.keys() ^ units_of(package))
        for path in SOURCES:
            if not within(module_of(path), (package,)) or module_of(path) == package:
                continue
            own = module_of(path).removeprefix(f"{package}.").split(".")[0]
            for module in imported(path):
                other = module.removeprefix(f"{package}.").split(".")[0]
                if within(module, (package,)) and other != own and level.get(other, 0) >= level.get(own, 0):
                    yield f"{relative(path)} imports {module}, which is not below it in {package}"


def every_package_with_sub_packages_has_inner_levels() -> Iterator[str]:
    for path in SOURCES:
        package = module_of(path)
        if path.name == "__init__.py" and package.count(".") and any(
            (path_of(package) / unit / "__init__.py").is_file() for unit in units_of(package) - {"kernels"}
        ):
            yield from () if package in INNER_LEVELS else (f"{package} has sub-packages: place them in INNER_LEVELS",)


def planning_and_estimation_never_see_the_ground_truth() -> Iterator[str]:
    for path in LIBRARY:
        if package_of(module_of(path)) in WALL:
            yield from (f"{relative(path)} imports {name}" for name in imported(path) if package_of(name) == "world")


def a_face_imports_nothing_of_its_package_before_it_is_asked_for() -> Iterator[str]:
    for stub in FACES:
        named = imported(stub.with_suffix(".py")) - {"os", "nerfnav.core.renamed"}
        yield from (f"{relative(stub.with_suffix('.py'))} imports {name}" for name in named)


def what_a_package_has_on_its_face_is_imported_from_there_by_other_packages() -> Iterator[str]:
    faces = {name: face for stub in FACES if stub.parent.name != "nerfnav" for name, face in on_the_face(stub).items()}
    for path in SOURCES:
        for node in nodes_of(path):
            if isinstance(node, ast.ImportFrom):
                for alias in node.names:
                    face = faces.get((node.module or "", alias.name))
                    if face is not None and not within(module_of(path), (face,)) and not alias.asname:
                        yield f"{relative(path)}: {alias.name} is on the face of {face}"


def scenes_do_not_import_the_app() -> Iterator[str]:
    for path in SOURCES:
        if path.is_relative_to(ROOT / "scenes"):
            yield from (f"{relative(path)} imports {name}" for name in imported(path) if within(name, ("nerfnav_app",)))


def no_file_imports_a_folder_by_a_name_that_others_have() -> Iterator[str]:
    for path in (*SOURCES, *(ROOT / "tests").rglob("*.py"), *(ROOT / "examples").rglob("*.py")):
        yield from (f"{relative(path)} imports {name}" for name in imported(path) if within(name, tuple(IMPORT_NAMES)))


def no_module_imports_itself_through_others() -> Iterator[str]:
    graph = {module_of(path): {name for name in imported(path) if is_module(name)} for path in SOURCES}
    done: set[str] = set()

    def visit(module: str, trail: tuple[str, ...]) -> Iterator[str]:
        if module in trail:
            yield f"import cycle: {' -> '.join((*trail, module))}"
        elif module not in done:
            for other in sorted(graph.get(module, ())):
                yield from visit(other, (*trail, module))
            done.add(module)

    for module in graph:
        yield from visit(module, ())


def the_library_has_no_viewer_no_threads_no_arguments_and_no_prints() -> Iterator[str]:
    banned = {"viser", "threading", "argparse", "tyro", "tqdm", "rich", "concurrent", "multiprocessing"}
    for path in LIBRARY:
        roots = {module.split(".")[0] for module in imported(path)}
        allowed = {"multiprocessing", "concurrent"} if module_of(path) in SIDE_BY_SIDE else set()
        yield from (f"{relative(path)} imports {name}" for name in roots & (banned - allowed))
        for node in nodes_of(path):
            if isinstance(node, ast.Name) and node.id == "print":
                yield f"{relative(path)} prints"
            if isinstance(node, ast.Attribute) and node.attr == "argv":
                yield f"{relative(path)} reads argv"


def files_stay_small() -> Iterator[str]:
    for path in SOURCES:
        if len(path.read_text().splitlines()) > 400:
            yield f"{relative(path)} is too long: split it"


def a_room_of_the_app_imports_only_what_its_row_allows() -> Iterator[str]:
    for path in APP:
        room = module_of(path).split(".")[1]
        if room not in ROOMS:
            yield f"app/{room} has no row: place it in ROOMS"
        allowed = tuple(f"nerfnav_app.{name}" for name in (room, *ROOMS.get(room, ())))
        for module in imported(path):
            if within(module, ("nerfnav_app",)) and not within(module, allowed):
                yield f"{relative(path)} imports {module}, which app/{room} may not"


def the_rooms_stand_on_floors() -> Iterator[str]:
    floors = list(ROOMS)
    for room, others in ROOMS.items():
        for other in others:
            if not floors.index(other.split(".")[0]) > floors.index(room):
                yield f"{room} is below {other}"


def viser_threads_and_torchs_settings_are_named_where_they_belong() -> Iterator[str]:
    for path in APP:
        module = module_of(path)
        for name, places in ONLY_IN.items():
            named = [other for other in imported(path) if within(other, (name,)) and other != "viser.transforms"]
            if named and not within(module, places):
                yield f"{relative(path)} imports {named}"
        if not within(module, SETTING_THREADS) and "set_num_threads" in path.read_text():
            yield f"{relative(path)} sets torch's threads"


def packages_of_the_app_are_empty_so_that_the_page_is_shown_before_torch_is_imported() -> Iterator[str]:
    for path in SOURCES:
        if path.name == "__init__.py" and path.is_relative_to(ROOT / "app") and imported(path):
            yield f"{relative(path)} imports {imported(path)}"


RULES: tuple[Callable[[], Iterator[str]], ...] = (
    the_library_imports_only_from_lower_levels,
    inside_a_package_imports_point_down_too,
    every_package_with_sub_packages_has_inner_levels,
    planning_and_estimation_never_see_the_ground_truth,
    a_face_imports_nothing_of_its_package_before_it_is_asked_for,
    what_a_package_has_on_its_face_is_imported_from_there_by_other_packages,
    scenes_do_not_import_the_app,
    no_file_imports_a_folder_by_a_name_that_others_have,
    no_module_imports_itself_through_others,
    the_library_has_no_viewer_no_threads_no_arguments_and_no_prints,
    files_stay_small,
    a_room_of_the_app_imports_only_what_its_row_allows,
    the_rooms_stand_on_floors,
    viser_threads_and_torchs_settings_are_named_where_they_belong,
    packages_of_the_app_are_empty_so_that_the_page_is_shown_before_torch_is_imported,
)
"""Each yields a sentence for each place that breaks it."""


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.__name__)
def test_nothing_breaks_the_rule(rule: Callable[[], Iterator[str]]) -> None:
    assert not list(rule())
