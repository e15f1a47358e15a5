"""The architecture as the import graph shows it."""

import ast
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LEVELS = (
    ("errors", "kernel_cache", "kernel_locator"),
    ("structs", "compiled", "files", "extras", "glb", "memory"),
    ("geometry", "cached", "registry"),
    ("world", "field", "robots"),
    ("importers", "planner", "estimator"),
    ("navigation", "tracking"),
    ("export", "live"),
    ("experiments",),
    ("api",),
)
"""Packages of nerfnav from the ground up; a package imports only from levels below its own, and itself."""
BESIDE = {("world", "robots")}
"""Exceptions within a level: ground truth judges the bodies of robots."""
WALL = ("planner", "estimator", "navigation", "tracking")
"""They plan and estimate on the field alone: planned on the field, judged on the mesh."""
ROOMS: dict[str, tuple[str, ...]] = {
    "cli": ("server", "live", "page", "page_server", "jobs", "storage", "places", "security", "system", "text"),
    "server": ("page", "page_server", "worker", "ui_loop", "state", "places", "security"),
    "live": ("security", "system"),
    "ui_loop": ("reducers", "state"),
    "page_server": ("page.theme", "places", "security"),
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
"""Rooms of app/, the highest floor first, and what each may import of app/ besides itself."""
ONLY_IN = {
    "viser": ("app.page", "app.page_server", "app.security", "app.cli.serve"),
    "threading": ("app.worker", "app.ui_loop", "app.security", "app.cli.serve"),
}
"""Modules of app/ that may import these."""
SETTING_THREADS = ("app.worker", "app.live", "app.cli.progress", "app.benchmarks")
"""Modules of app/ that may tell torch how many threads it has."""
SOURCES = sorted(path for folder in ("nerfnav", "scenes", "app") for path in (ROOT / folder).rglob("*.py"))
LIBRARY = [path for path in SOURCES if path.is_relative_to(ROOT / "nerfnav")]


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def nodes_of(path: Path) -> tuple[ast.AST, ...]:
    return tuple(ast.walk(ast.parse(path.read_text())))


@cache
def imported(path: Path) -> set[str]:
    """Every module that a file names in an import, anywhere in it, as deep as it can be resolved."""
    modules: set[str] = set()
    for node in nodes_of(path):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the layers"
            base = node.module or ""
            modules |= {f"{base}.{alias.name}" if is_module(f"{base}.{alias.name}") else base for alias in node.names}
    return modules


@cache
def is_module(name: str) -> bool:
    path = ROOT.joinpath(*name.split("."))
    return path.with_suffix(".py").is_file() or (path / "__init__.py").is_file()


def package_of(module: str) -> str | None:
    """The part of nerfnav that a module belongs to; None for modules that are not nerfnav's."""
    parts = module.split(".")
    return parts[1] if parts[0] == "nerfnav" and len(parts) > 1 else None


def level_of(package: str) -> int:
    found = [index for index, level in enumerate(LEVELS) if package in level]
    assert found, f"nerfnav.{package} has no level: place it in LEVELS"
    return found[0]


def relative(path: Path) -> str:
    return str(path.relative_to(ROOT))


@pytest.mark.parametrize("path", LIBRARY, ids=relative)
def test_the_library_imports_only_from_lower_levels(path: Path) -> None:
    own = package_of(module_of(path))
    for module in imported(path):
        assert module.split(".")[0] not in ("app", "scenes"), f"{relative(path)} imports {module}"
        other = package_of(module)
        if own is None or other is None or own == other or (own, other) in BESIDE:
            continue
        assert level_of(other) < level_of(own), f"{relative(path)} imports {module}, which is not below it"


@pytest.mark.parametrize("path", [p for p in LIBRARY if package_of(module_of(p)) in WALL], ids=relative)
def test_planning_and_estimation_never_see_the_ground_truth(path: Path) -> None:
    assert not [module for module in imported(path) if package_of(module) == "world"]


FACES = sorted((ROOT / "nerfnav").rglob("__init__.pyi"))


def package_path(stub: Path) -> str:
    return ".".join(stub.parent.relative_to(ROOT).parts)


def on_the_face(stub: Path) -> dict[tuple[str, str], str]:
    """(Module, name) to the package that gives the name, for what a face names."""
    package = package_path(stub)
    imports = [node for node in ast.parse(stub.read_text()).body if isinstance(node, ast.ImportFrom) and node.module]
    return {(f"{package}.{node.module}", alias.name): package for node in imports for alias in node.names}


@cache
def on_all_faces() -> dict[tuple[str, str], str]:
    return {name: face for stub in FACES if stub.parent.name != "nerfnav" for name, face in on_the_face(stub).items()}


@pytest.mark.parametrize("stub", FACES, ids=relative)
def test_a_face_imports_nothing_of_its_package_before_it_is_asked_for(stub: Path) -> None:
    assert imported(stub.with_suffix(".py")) <= {"os", "lazy_loader"}


@pytest.mark.parametrize("path", SOURCES, ids=relative)
def test_what_a_package_has_on_its_face_is_imported_from_there_by_other_packages(path: Path) -> None:
    for node in nodes_of(path):
        if isinstance(node, ast.ImportFrom):
            for alias in node.names:
                face = on_all_faces().get((node.module or "", alias.name))
                inside = face is None or within(module_of(path), (face,))
                assert inside or alias.asname, f"{relative(path)}: {alias.name} is on the face of {face}"


def test_scenes_do_not_import_the_app() -> None:
    for path in SOURCES:
        if path.is_relative_to(ROOT / "scenes"):
            assert not [module for module in imported(path) if module.split(".")[0] == "app"], relative(path)


def test_no_module_imports_itself_through_others() -> None:
    graph = {module_of(path): {name for name in imported(path) if is_module(name)} for path in SOURCES}
    done: set[str] = set()

    def visit(module: str, trail: tuple[str, ...]) -> None:
        assert module not in trail, f"import cycle: {' -> '.join((*trail, module))}"
        if module not in done:
            for other in sorted(graph.get(module, ())):
                visit(other, (*trail, module))
            done.add(module)

    for module in graph:
        visit(module, ())


@pytest.mark.parametrize("path", LIBRARY, ids=relative)
def test_the_library_has_no_viewer_no_threads_no_arguments_and_no_prints(path: Path) -> None:
    roots = {module.split(".")[0] for module in imported(path)}
    banned = {"viser", "threading", "argparse", "tyro", "tqdm", "rich", "concurrent", "multiprocessing"}
    assert not roots & banned, f"{relative(path)} imports {roots & banned}"
    for node in nodes_of(path):
        assert not (isinstance(node, ast.Name) and node.id == "print"), f"{relative(path)} prints"
        assert not (isinstance(node, ast.Attribute) and node.attr == "argv"), f"{relative(path)} reads argv"


@pytest.mark.parametrize("path", SOURCES, ids=relative)
def test_files_stay_small(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 270, f"{relative(path)} is too long: split it"


APP = [path for path in SOURCES if path.is_relative_to(ROOT / "app") and path.name != "__init__.py"]


def within(module: str, places: tuple[str, ...]) -> bool:
    """Whether a module is one of these, or in one of these packages."""
    return any(module == place or module.startswith(f"{place}.") for place in places)


@pytest.mark.parametrize("path", APP, ids=relative)
def test_a_room_of_the_app_imports_only_what_its_row_allows(path: Path) -> None:
    room = module_of(path).split(".")[1]
    assert room in ROOMS, f"app/{room} has no row: place it in ROOMS"
    allowed = tuple(f"app.{name}" for name in (room, *ROOMS[room]))
    for module in imported(path):
        if within(module, ("app",)):
            assert within(module, allowed), f"{relative(path)} imports {module}, which app/{room} may not"


def test_the_rooms_stand_on_floors() -> None:
    floors = list(ROOMS)
    for room, others in ROOMS.items():
        for other in others:
            assert floors.index(other.split(".")[0]) > floors.index(room), f"{room} is below {other}"


@pytest.mark.parametrize("path", APP, ids=relative)
def test_viser_threads_and_torchs_settings_are_named_where_they_belong(path: Path) -> None:
    module = module_of(path)
    for name, places in ONLY_IN.items():
        named = [other for other in imported(path) if within(other, (name,)) and other != "viser.transforms"]
        assert not named or within(module, places), f"{relative(path)} imports {named}"
    if not within(module, SETTING_THREADS):
        assert "set_num_threads" not in path.read_text(), f"{relative(path)} sets torch's threads"


@pytest.mark.parametrize("path", [p for p in SOURCES if p.name == "__init__.py" and "app" in p.parts], ids=relative)
def test_packages_of_the_app_are_empty_so_that_the_page_is_shown_before_torch_is_imported(path: Path) -> None:
    assert not imported(path)
