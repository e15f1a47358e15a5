"""Structure and language of the code in numbers, against the limits of the project's house rules.

    python -m tests.measure_house            # a table; exit status 1 where a limit is exceeded
    python -m tests.measure_house --names    # and the places behind its counts
    python -m tests.measure_house --root ../other-checkout

For each of app, nerfnav and scenes:

    modules     `*.py` without `__init__.py`
    statements  nodes of the syntax tree that are statements, imports included
    lines       of a file, blank lines and comments included: median and longest
    largest     most modules in one folder
    smallest    fewest modules in a sub-package (a folder below the packages of ARCHITECTURE.md; kernels apart)
    small       modules under 40 lines whose only importer stands in the same package. Exempt are entries of a registry,
                queries, cost terms, and modules that are light on purpose, see EXEMPT.
    tuples      parameters and fields that are tuples of unlike things, also behind `| None`, an alias or a container
    openings    share of docstrings that begin with What, Where, How, Whether, Who, Whose or Which
    short       docstrings of three words or fewer on public modules, classes and functions
    words       occurrences of words of an idiom of our own, see WORDS; documents and examples count for nerfnav

Import rules broken are those of tests/test_imports.py.
"""

import argparse
import ast
import itertools
import re
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

from tests.test_imports import RULES

ROOT = Path(__file__).parents[1]
PACKAGES = {"app": "nerfnav_app", "nerfnav": "nerfnav", "scenes": "nerfnav_scenes"}
"""Folder to import name."""
MOST_MODULES, FEWEST_MODULES = 20, 4
"""Of a folder, and of a sub-package."""
LONGEST, SMALL = 400, 40
"""Lines of a file; under SMALL, a module with one importer belongs into it."""
MOST_OPENINGS = 0.02
"""Share of docstrings that begin with a question word."""
WORDS = ("told", "whoever", "dearer", "nobody", "from nothing", "put right")
OPENINGS = re.compile(r"(What|Where|How|Whether|Who|Whose|Which)\b")
EXEMPT = (
    "app/cli/commands/", "app/queries/", "app/page/layers/", "app/page/panels/", "app/benchmarks/",
    "nerfnav/planner/terms/", "nerfnav/planner/planners/", "nerfnav/export/", "nerfnav/core/",
    "app/text.py", "app/system.py", "scenes/",
)  # fmt: skip
"""Entries of registries, queries and cost terms, and modules that are imported before torch."""


@dataclass
class Counted:
    """Figures of one package, with the places behind them."""

    lines: dict[str, int] = field(default_factory=dict)
    statements: int = 0
    docstrings: int = 0
    found: dict[str, list[str]] = field(default_factory=lambda: defaultdict(list))
    """A rule to the places that break it."""


def docstrings_of(tree: ast.Module) -> Iterator[tuple[int, bool, str]]:
    """Line, whether it counts as short, and text of each docstring of modules, classes, functions and fields."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                name = getattr(node, "name", "module")
                yield node.body[0].lineno, not name.startswith("_"), text
        if isinstance(node, ast.Module | ast.ClassDef):
            for before, after in itertools.pairwise(node.body):
                if not isinstance(before, ast.Assign | ast.AnnAssign) or not isinstance(after, ast.Expr):
                    continue
                if isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
                    yield after.lineno, False, after.value.value  # a unit alone may say enough of a field


def unlike_tuples(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and name of parameters and fields whose annotation holds a tuple of two or more different types."""
    aliases = {
        node.targets[0].id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            arguments = (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)
            named = [(one.arg, one.annotation) for one in arguments]
        elif isinstance(node, ast.ClassDef):
            named = [(one.target.id, one.annotation) for one in node.body
                     if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)]  # fmt: skip
        else:
            continue
        for name, annotation in named:
            if annotation is not None and _holds_unlike(annotation, aliases):
                yield annotation.lineno, name


def _holds_unlike(annotation: ast.expr, aliases: dict[str, ast.expr]) -> bool:
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        try:
            annotation = ast.parse(annotation.value, mode="eval").body
        except SyntaxError:
            return False
    for node in ast.walk(annotation):
        if isinstance(node, ast.Name) and node.id in aliases and isinstance(aliases[node.id], ast.Subscript):
            node = aliases[node.id]
        if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name) and node.value.id == "tuple":
            parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            kinds = {ast.unparse(part) for part in parts} - {"..."}
            if len(kinds) > 1:
                return True
    return False


def importers_of(root: Path) -> dict[str, set[str]]:
    """Each module (dotted) to the modules that import it, faces included."""
    modules = {_dotted(root, path): path for folder in PACKAGES for path in (root / folder).rglob("*.py")}
    found: dict[str, set[str]] = defaultdict(set)
    for name, path in modules.items():
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                for alias in node.names:
                    full = f"{node.module}.{alias.name}"
                    found[full if full in modules else node.module].add(name)
            elif isinstance(node, ast.Import):
                for alias in node.names:
                    found[alias.name].add(name)
    for stub in (root / "nerfnav").rglob("__init__.pyi"):
        face = _dotted(root, stub)
        for node in ast.parse(stub.read_text()).body:
            if isinstance(node, ast.ImportFrom) and node.module:
                found[f"{face}.{node.module}" if node.level else node.module].add(face)
    return found


def _dotted(root: Path, path: Path) -> str:
    folder, *rest = path.relative_to(root).with_suffix("").parts
    parts = [PACKAGES.get(folder, folder), *rest]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def count(root: Path, folder: str, importers: dict[str, set[str]]) -> Counted:
    """Measure one package."""
    result = Counted()
    for path in sorted((root / folder).rglob("*.py")):
        text = path.read_text()
        tree = ast.parse(text)
        place = path.relative_to(root).as_posix()
        result.statements += sum(isinstance(node, ast.stmt) for node in ast.walk(tree))
        for line, public, docstring in docstrings_of(tree):
            result.docstrings += 1
            if OPENINGS.match(docstring):
                result.found["openings"].append(f"{place}:{line}: {docstring.splitlines()[0][:80]}")
            if public and len(docstring.split()) <= 3:
                result.found["short"].append(f"{place}:{line}: {docstring}")
        result.found["tuples"] += [f"{place}:{line}: {name}" for line, name in unlike_tuples(tree)]
        result.found["words"] += words_in(place, text)
        if path.name == "__init__.py":
            continue
        lines = len(text.splitlines())
        result.lines[place] = lines
        if lines > LONGEST:
            result.found["long"].append(f"{place}: {lines} lines")
        dotted = _dotted(root, path)
        package = ".".join(dotted.split(".")[:2])
        others = importers.get(dotted, set())
        if lines < SMALL and len(others) == 1 and not place.startswith(EXEMPT):
            (only,) = others
            if only.startswith(f"{package}."):
                result.found["small"].append(f"{place}: {lines} lines, imported by {only}")
    return result


def words_in(place: str, text: str) -> list[str]:
    """Places where a word of WORDS stands in a text."""
    pattern = re.compile(rf"\b({'|'.join(WORDS)})\b", re.IGNORECASE)
    return [
        f"{place}:{number}: {line.strip()[:90]}"
        for number, line in enumerate(text.splitlines(), 1)
        for _ in pattern.finditer(line)
    ]


def folders_of(counted: Counted) -> Counter[str]:
    """Modules in each folder."""
    return Counter(place.rsplit("/", 1)[0] for place in counted.lines)


def main() -> None:
    """Print the table; exit with 1 where a limit is exceeded."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout to measure")
    parser.add_argument("--names", action="store_true", help="list the places behind the counts")
    options = parser.parse_args()
    root = options.root.resolve()
    importers = importers_of(root)
    print(f"{'':<9}{'modules':>8}{'statements':>11}{'median':>7}{'longest':>8}{'largest':>8}{'smallest':>9}"
          f"{'small':>6}{'tuples':>7}{'openings':>9}{'short':>6}{'words':>6}")  # fmt: skip
    broken: list[str] = []
    for name in PACKAGES:
        counted = count(root, name, importers)
        if name == "nerfnav":
            documents = [*root.glob("*.md"), *(root / "docs").rglob("*.md"), *(root / "examples").glob("*.py")]
            for path in sorted(documents):
                counted.found["words"] += words_in(path.relative_to(root).as_posix(), path.read_text())
        sizes = folders_of(counted)
        below = {folder: size for folder, size in sizes.items() if folder.count("/") > 1 and "kernels" not in folder}
        share = len(counted.found["openings"]) / max(counted.docstrings, 1)
        lengths = list(counted.lines.values())
        print(f"{name:<9}{len(lengths):>8}{counted.statements:>11}{median(lengths):>7.0f}{max(lengths):>8}"
              f"{max(sizes.values()):>8}{min(below.values(), default=0):>9}{len(counted.found['small']):>6}"
              f"{len(counted.found['tuples']):>7}{share:>9.1%}{len(counted.found['short']):>6}"
              f"{len(counted.found['words']):>6}")  # fmt: skip
        if share <= MOST_OPENINGS:
            counted.found.pop("openings")
        outside = {folder: size for folder, size in sizes.items() if size > MOST_MODULES}
        outside |= {folder: size for folder, size in below.items() if size < FEWEST_MODULES}
        counted.found["folders"] = [f"{folder}: {size} modules" for folder, size in outside.items()]
        broken += [f"{rule}: {place}" for rule, places in counted.found.items() for place in places]
    if root == ROOT:  # the rules on imports are those of this checkout
        broken += [f"imports: {wrong}" for rule in RULES for wrong in rule()]
    print(f"limits exceeded: {len(broken)}", *(broken if options.names else ()), sep="\n  ")
    sys.exit(bool(broken))


if __name__ == "__main__":
    main()
