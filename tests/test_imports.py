"""The architecture as the import graph shows it."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
LEVELS = (
    ("errors",),
    ("structs", "compiled", "files", "extras"),
    ("geometry", "cached", "registry"),
    ("world", "field", "robots"),
    ("importers", "planner", "estimator"),
    ("navigation",),
    ("experiments", "export"),
    ("api",),
)
"""Packages of nerfnav from the ground up; a package imports only from levels below its own, and itself."""
BESIDE = {("world", "robots")}
"""Exceptions within a level: ground truth judges the bodies of robots."""
WALL = ("planner", "estimator", "navigation")
"""They plan and estimate on the field alone: planned on the field, judged on the mesh."""
SOURCES = sorted(path for folder in ("nerfnav", "scenes", "app") for path in (ROOT / folder).rglob("*.py"))
LIBRARY = [path for path in SOURCES if path.is_relative_to(ROOT / "nerfnav")]


def module_of(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imported(path: Path) -> set[str]:
    """Every module that a file names in an import, anywhere in it, as deep as it can be resolved."""
    modules: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            modules |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative imports hide the layers"
            base = node.module or ""
            modules |= {f"{base}.{alias.name}" if is_module(f"{base}.{alias.name}") else base for alias in node.names}
    return modules


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


def test_the_front_of_the_library_imports_nothing_of_it_before_it_is_asked_for() -> None:
    front = ast.parse((ROOT / "nerfnav" / "__init__.py").read_text())
    named = {alias.name for node in front.body if isinstance(node, ast.Import) for alias in node.names}
    named |= {str(node.module) for node in front.body if isinstance(node, ast.ImportFrom)}
    assert named == {"os", "importlib", "typing"}, "of nerfnav, only inside `if TYPE_CHECKING`"


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
    for node in ast.walk(ast.parse(path.read_text())):
        assert not (isinstance(node, ast.Name) and node.id == "print"), f"{relative(path)} prints"
        assert not (isinstance(node, ast.Attribute) and node.attr == "argv"), f"{relative(path)} reads argv"


@pytest.mark.parametrize("path", SOURCES, ids=relative)
def test_files_stay_small(path: Path) -> None:
    assert len(path.read_text().splitlines()) <= 270, f"{relative(path)} is too long: split it"
