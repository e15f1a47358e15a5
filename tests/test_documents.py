"""CONTRIBUTING, ARCHITECTURE, CHANGELOG and CITATION say what is so; README has tests of its own."""

import importlib
import importlib.util
import re
import shlex
import tomllib
from pathlib import Path

import pytest
import yaml

from nerfnav_app.cli.main import COMMANDS, parse
from tests import test_imports

ROOT = Path(__file__).parents[1]
DOCUMENTS = ("README.md", "CONTRIBUTING.md", "ARCHITECTURE.md", "CHANGELOG.md")
FOLDERS = ("app", "nerfnav", "scenes", "static", "tests", "examples", ".ci")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
TOOLS = ("pytest", "ruff", "pyright", "python")


def text_of(document: str) -> str:
    return (ROOT / document).read_text()


def paths_in(document: str) -> list[str]:
    """Paths of the repository that a document names, in backquotes or as the target of a link."""
    text = re.sub(r"```.*?```", "", text_of(document), flags=re.DOTALL)
    named = re.findall(r"`([\w./-]+/[\w./-]*)`", text)
    linked = re.findall(r"\]\(([^)#:]+)\)", text)
    return [path for path in named if path.split("/")[0] in FOLDERS] + linked


def words_of(line: str) -> list[str]:
    return shlex.split(line, comments=True)


def commands() -> list[list[str]]:
    """The words of every command in CONTRIBUTING."""
    blocks = re.findall(r"```sh\n(.*?)```", text_of("CONTRIBUTING.md"), re.DOTALL)
    return [words for block in blocks for line in block.splitlines() if (words := words_of(line))]


def rows(heading: str) -> list[list[str]]:
    """The cells of the table under a heading of ARCHITECTURE, without its first two lines."""
    section = text_of("ARCHITECTURE.md").split(f"## {heading}", 1)[1].split("\n## ", 1)[0]
    lines = [line for line in section.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def name_in(cell: str) -> str:
    (name,) = re.findall(r"`([\w.]+)`", cell)
    return name


@pytest.mark.parametrize("document", [name for name in DOCUMENTS if name != "CHANGELOG.md"])  # it tells of the past
def test_every_path_that_a_document_names_exists(document: str) -> None:
    missing = [path for path in paths_in(document) if not (ROOT / path).exists()]
    assert not missing


def test_documents_name_enough_paths_for_the_test_above_to_mean_something() -> None:
    assert len(paths_in("CONTRIBUTING.md")) > 30 and len(paths_in("ARCHITECTURE.md")) > 50


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


def test_contributing_names_the_quick_tests_first_then_all_then_the_other_checks() -> None:
    assert [" ".join(words) for words in commands()] == [
        "pytest -n auto -m not browser and not slow", "pytest -n auto", "ruff check .", "pyright",
        "python -m tests.measure_house",
    ]  # fmt: skip


def test_every_name_of_a_recipe_can_be_imported() -> None:
    names = re.findall(r"`((?:nerfnav|nerfnav_app)(?:\.\w+)+)", text_of("CONTRIBUTING.md"))
    assert len(names) >= 5
    for name in names:
        module, _, attribute = name.rpartition(".")
        assert callable(getattr(importlib.import_module(module), attribute)), name


def test_contributing_has_a_recipe_for_each_kind_of_addition() -> None:
    recipes = re.findall(r"^### An? (.+)$", text_of("CONTRIBUTING.md"), re.MULTILINE)
    assert recipes == ["planner", "cost", "robot", "field", "export format", "panel", "query"]


def test_the_rooms_of_the_app_are_those_of_the_import_test() -> None:
    told = {name_in(room): tuple(re.findall(r"`([\w.]+)`", allowed)) for room, _, allowed in rows("The app")}
    assert told == test_imports.ROOMS
    assert list(told) == list(test_imports.ROOMS), "the highest floor first"
    assert all(allowed or cell == "nothing" for allowed, (*_, cell) in zip(told.values(), rows("The app"), strict=True))


def test_the_levels_of_the_library_are_those_of_the_import_test() -> None:
    told: dict[int, tuple[str, ...]] = {}
    for level, package, _ in rows("The library"):
        told[int(level)] = (*told.get(int(level), ()), name_in(package))
    assert tuple(told[level] for level in sorted(told)) == test_imports.LEVELS


def test_every_room_and_package_of_the_tree_is_in_a_table() -> None:
    for folder, heading, column in (("app", "The app", 0), ("nerfnav", "The library", 1)):
        told = {name_in(row[column]) for row in rows(heading)}
        found = (path for path in (ROOT / folder).iterdir() if path.suffix == ".py" or (path / "__init__.py").is_file())
        assert told == {path.stem for path in found} - {"__init__"}


def test_the_glossary_has_about_twenty_terms_in_order() -> None:
    glossary = text_of("ARCHITECTURE.md").split("## Glossary", 1)[1]
    terms = re.findall(r"^- \*\*([^*]+)\*\*", glossary, re.MULTILINE)
    assert terms == sorted(terms, key=str.lower) and 18 <= len(terms) <= 26


def test_the_changelog_begins_with_what_is_unreleased_and_names_real_commands() -> None:
    text = text_of("CHANGELOG.md")
    versions = re.findall(r"^## (.+)$", text, re.MULTILINE)
    assert versions[0] == "Unreleased" and re.fullmatch(r"\d+\.\d+\.\d+ - \d{4}-\d{2}-\d{2}", versions[1])
    assert set(re.findall(r"^### (\w+)$", text, re.MULTILINE)) <= {"Added", "Changed", "Removed", "Fixed", "Security"}
    assert set(re.findall(r"`nerfnav (\w+)`", text)) <= set(COMMANDS)
    assert parse(["import", "nerf", "--out", "x.npz", "--keep-network"])[1].keep_network


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
    assert (paper["start"], paper["end"]) == (4606, 4613)
