"""How much memory is to be had, and what is refused."""

from pathlib import Path

import pytest

from nerfnav.core import memory
from nerfnav.core.errors import InvalidInputError


def test_free_memory_is_told_in_bytes_or_not_at_all():
    free = memory.available_memory()
    assert free is None or free > 10**7


def test_what_is_too_large_is_refused_with_both_numbers_and_what_would_fit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(memory, "available_memory", lambda: 2 * 10**9)
    memory.require_memory(10**9, "a map", "choose a larger voxel")
    with pytest.raises(InvalidInputError, match=r"^a map may take 5\.0 GB, and 2\.0 GB .* choose a larger voxel$"):
        memory.require_memory(5 * 10**9, "a map", "choose a larger voxel")


@pytest.mark.parametrize(
    ("line", "files"),
    [
        ("0::/work/one", {"work/one/memory.max": "max", "work/memory.max": "3000", "work/memory.current": "1000"}),
        (
            "7:cpu,memory:/job",
            {"memory/job/memory.limit_in_bytes": "3000", "memory/job/memory.usage_in_bytes": "1000"},
        ),
    ],
)
def test_limits_of_control_groups_count_up_to_the_root(
    line: str, files: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content + "\n")
    read = memory._text
    monkeypatch.setattr(memory, "_GROUPS", tmp_path)
    monkeypatch.setattr(memory, "_text", lambda path: line if path == Path("/proc/self/cgroup") else read(path))
    assert memory.available_memory() == 2000


def test_files_that_a_group_has_cached_are_free(tmp_path: Path):
    (tmp_path / "memory.max").write_text("3000")
    (tmp_path / "memory.current").write_text("1000")
    (tmp_path / "memory.stat").write_text("anon 500\ninactive_file 400\n")
    assert list(memory._of_group(tmp_path, ("memory.max", "memory.current", "inactive_file"))) == [2400]
