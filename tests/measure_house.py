"""How the code is built, in numbers: files, their lengths, long functions, busy modules, imports against the tables.

    python -m tests.measure_house            # prints a table
    python -m tests.measure_house --names    # and the modules and functions behind its counts
    python -m tests.measure_house --root ../other-checkout

Counted are, for each package (subpackages and `__init__.py` included):

    files       `*.py`
    lines       of a file, blank lines and comments included
    functions   `def` and `async def` at any depth whose lines, from `def` to the last of the body, are more than 40
    imports     `import` and `from ... import` statements anywhere in a module (nodes of its syntax tree: one statement
                counts once, however many names it takes, and so do those inside functions); busy are more than 12

Imports against the tables are what breaks a rule of tests/test_imports.py.

At commit e71b9a7 busy modules were 29 of 131 in app and 51 of 218 in nerfnav.
"""

import argparse
import ast
import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import median

from tests.test_imports import RULES

ROOT = Path(__file__).parents[1]
PACKAGES = ("app", "nerfnav", "scenes")
MOST_LINES = 40
"""Of a function."""
MOST_IMPORTS = 12
"""Of a module."""


@dataclass(frozen=True)
class Module:
    """One file, measured."""

    path: Path
    lines: int
    imports: int
    """Statements."""
    long_functions: tuple[tuple[str, int], ...]
    """Name and lines of each function that is too long."""


def measured(path: Path) -> Module:
    """Read a file and count."""
    source = path.read_text()
    nodes = list(ast.walk(ast.parse(source)))
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    lengths = [(node.name, (node.end_lineno or node.lineno) - node.lineno + 1) for node in functions]
    imports = sum(isinstance(node, ast.Import | ast.ImportFrom) for node in nodes)
    long = tuple((name, lines) for name, lines in lengths if lines > MOST_LINES)
    return Module(path, len(source.splitlines()), imports, long)


def modules_of(package: Path) -> list[Module]:
    """All modules of a package, measured."""
    return [measured(path) for path in sorted(package.rglob("*.py"))]


def row(name: str, modules: list[Module]) -> str:
    """A line of the table."""
    lines = [module.lines for module in modules]
    long = sum(len(module.long_functions) for module in modules)
    busy = sum(module.imports > MOST_IMPORTS for module in modules)
    return f"{name:<9}{len(modules):>6}{median(lines):>8.0f}{max(lines):>9}{long:>16}{busy:>14}"


def names_of(modules: list[Module], root: Path) -> list[str]:
    """The busy modules, busiest first, and the long functions."""
    busy = sorted((module for module in modules if module.imports > MOST_IMPORTS), key=lambda module: -module.imports)
    told = [
        f"  {module.imports:>3} imports {module.lines:>4} lines  {module.path.relative_to(root)}" for module in busy
    ]
    for module in modules:
        told += [
            f"  {lines:>3} lines of {name} in {module.path.relative_to(root)}" for name, lines in module.long_functions
        ]
    return told


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout to measure")
    parser.add_argument("--names", action="store_true", help="tell which modules and functions are counted")
    asked = parser.parse_args()
    root = asked.root.resolve()
    heads = f"functions > {MOST_LINES}", f"imports > {MOST_IMPORTS}"
    print(f"{'':<9}{'files':>6}{'median':>8}{'longest':>9}{heads[0]:>16}{heads[1]:>14}")
    for name in PACKAGES:
        modules = modules_of(root / name)
        print(row(name, modules))
        if asked.names:
            print("\n".join(names_of(modules, root)))
    if root == ROOT:  # the tables are those of this checkout
        against = [wrong for rule in RULES for wrong in rule()]
        print(f"imports against the tables: {len(against)}", *against, sep="\n  ")
        sys.exit(bool(against))


if __name__ == "__main__":
    main()
