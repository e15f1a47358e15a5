"""Documents: paths exist, commands parse, names import, and tables equal the import test."""

import importlib
import importlib.util
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml

from nerfnav_app.cli.main import COMMANDS
from tests import test_imports

ROOT = Path(__file__).parents[1]
PAGES = tuple(f"docs/{path.name}" for path in sorted((ROOT / "docs").glob("*.md")))
DOCUMENTS = ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", *PAGES)
FOLDERS = ("app", "nerfnav", "scenes", "static", "tests", "examples", "docs", "packaging", ".ci")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
TOOLS = ("pytest", "ruff", "pyright", "python")


def text_of(document: str) -> str:
    return (ROOT / document).read_text()


def paths_in(document: str) -> list[Path]:
    """Return the paths that a document names in backquotes, and the targets of its links and pictures."""
    text = re.sub(r"```.*?```", "", text_of(document), flags=re.DOTALL)
    named = re.findall(r"`([\w./-]+/[\w./-]*)`", text)
    linked = re.findall(r"\]\(([^)#:]+)(?:#[\w-]+)?\)", text)
    folder = (ROOT / document).parent
    return [ROOT / path for path in named if path.split("/")[0] in FOLDERS] + [folder / path for path in linked]


def words_of(line: str) -> list[str]:
    return shlex.split(line, comments=True)


def commands() -> list[list[str]]:
    """Return the words of every command in CONTRIBUTING."""
    blocks = re.findall(r"```sh\n(.*?)```", text_of("CONTRIBUTING.md"), re.DOTALL)
    return [words for block in blocks for line in block.splitlines() if (words := words_of(line))]


def rows(heading: str) -> list[list[str]]:
    """Return the cells of the table under a heading of ARCHITECTURE, without its first two lines."""
    section = text_of("ARCHITECTURE.md").split(f"## {heading}", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def name_in(cell: str) -> str:
    (name,) = re.findall(r"`([\w.]+)`", cell)
    return name


@pytest.mark.parametrize("document", DOCUMENTS)  # without the changelog, which names paths of the past
def test_every_path_that_a_document_names_exists(document: str) -> None:
    assert not [str(path) for path in paths_in(document) if not path.exists()]


@pytest.mark.parametrize("words", commands(), ids=" ".join)
def test_every_command_in_contributing_is_understood(words: list[str]) -> None:
    tool, *arguments = words
    assert tool in TOOLS
    if tool == "python":
        assert arguments[0] == "-m" and importlib.util.find_spec(arguments[1]) is not None
        return
    assert importlib.util.find_spec(tool) is not None
    if "-m" in arguments:
        marks = {mark.split(":")[0] for mark in PROJECT["tool"]["pytest"]["ini_options"]["markers"]}
        asked = set(re.findall(r"\w+", arguments[arguments.index("-m") + 1])) - {"not", "and", "or"}
        assert asked and asked <= marks


def test_every_name_of_a_recipe_can_be_imported() -> None:
    names = re.findall(r"`((?:nerfnav|nerfnav_app)(?:\.\w+)+)", text_of("CONTRIBUTING.md"))
    assert len(names) >= 5
    for name in names:
        module, _, attribute = name.rpartition(".")
        assert callable(getattr(importlib.import_module(module), attribute)), name


def test_the_packages_of_the_app_are_those_of_the_import_test() -> None:
    documented = {name_in(room): tuple(re.findall(r"`([\w.]+)`", allowed)) for room, _, allowed in rows("The app")}
    assert documented == test_imports.ROOMS
    assert list(documented) == list(test_imports.ROOMS), "the highest first"


def test_the_levels_of_the_library_are_those_of_the_import_test() -> None:
    documented: dict[int, tuple[str, ...]] = {}
    for level, package, _ in rows("The library"):
        documented[int(level)] = (*documented.get(int(level), ()), name_in(package))
    assert tuple(documented[level] for level in sorted(documented)) == test_imports.LEVELS


def test_the_sub_packages_are_those_of_the_import_test_in_its_order() -> None:
    documented: dict[str, list[str]] = {}
    for package, unit, _ in rows("Sub-packages"):
        documented.setdefault(name_in(package), []).append(name_in(unit))
    folders = {package: test_imports.path_of(package) for package in test_imports.INNER_LEVELS}
    assert documented == {
        package: [unit for level in levels for unit in level if (folders[package] / unit / "__init__.py").is_file()]
        for package, levels in test_imports.INNER_LEVELS.items()
    }


def test_every_package_of_the_tree_is_in_a_table() -> None:
    for folder, heading, column in (("app", "The app", 0), ("nerfnav", "The library", 1)):
        documented = {name_in(row[column]) for row in rows(heading)}
        found = (path for path in (ROOT / folder).iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file())
        assert documented == {path.stem for path in found} - {"__init__"}


def test_the_changelog_has_releases_and_one_line_an_entry_and_names_real_commands() -> None:
    text = text_of("CHANGELOG.md")
    versions = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert versions[0] == "Unreleased" and re.fullmatch(r"\d+\.\d+\.\d+ - \d{4}-\d{2}-\d{2}", versions[1])
    assert set(re.findall(r"^### (\w+)$", text, re.MULTILINE)) <= {"Added", "Changed", "Removed", "Fixed", "Security"}
    assert all(line.startswith("- ") for line in text.partition("## ")[2].splitlines()[1:] if line and line[0] != "#")
    assert set(re.findall(r"`nerfnav (\w+)", text)) <= set(COMMANDS)


def test_the_citation_is_whole() -> None:
    cited = yaml.safe_load(text_of("CITATION.cff"))
    assert {"cff-version", "message", "title", "type", "version", "license", "authors", "references"} <= cited.keys()
    assert (cited["cff-version"], cited["title"]) == ("1.2.0", "nerfnav")
    assert cited["license"] == PROJECT["project"]["license"]
    assert cited["version"] == importlib.import_module("nerfnav").__version__
    assert cited["authors"] == [{"name": "The nerfnav authors"}]
    (paper,) = cited["references"]
    assert paper["title"] == "Vision-Only Robot Navigation in a Neural Radiance World"
    assert [author["family-names"] for author in paper["authors"]] == [
        "Adamkiewicz", "Chen", "Caccavale", "Gardner", "Culbertson", "Bohg", "Schwager",
    ]  # fmt: skip
    assert (paper["year"], paper["volume"], paper["issue"]) == (2022, 7, 2)
    assert (paper["start"], paper["end"], paper["doi"]) == (4606, 4613, "10.1109/LRA.2022.3150497")
    assert f"https://doi.org/{paper['doi']}" in text_of("README.md")
