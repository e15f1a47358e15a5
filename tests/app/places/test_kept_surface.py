"""The key of kept surfaces: all modules that make a surface, and no others."""

import re
from pathlib import Path

from nerfnav_app.places.kept_surface import CODE

ROOT = Path(__file__).parents[3]
FILES = {file.resolve() for path in CODE for file in (path.rglob("*.py") if path.is_dir() else [path])}


def named(*paths: str) -> set[Path]:
    return {(ROOT / path).resolve() for path in paths}


def test_the_key_holds_what_makes_surfaces_and_nothing_that_only_trains_or_moves_fields() -> None:
    assert all(file.is_file() for file in FILES)
    assert named("app/jobs/export/surface.py", "nerfnav/field/surface/atlas.py") <= FILES
    assert not named("nerfnav/field/train/loop.py", "nerfnav/field/edit/move.py", "app/jobs/export/export.py") & FILES


def test_whatever_a_module_of_the_key_imports_of_fields_is_in_the_key() -> None:
    for file in FILES:
        for module in re.findall(r"^ *from (nerfnav\.field\.[\w.]+) import", file.read_text(), re.MULTILINE):
            path = (ROOT / module.replace(".", "/")).with_suffix(".py")
            if not path.is_file() or path.stem in ("pose_descent", "jacobian"):  # for poses
                continue
            assert path.resolve() in FILES, f"{file.name} imports {module}"
