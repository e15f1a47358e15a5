"""The kernel cache: its key covers every file with a kernel, and a kernel elsewhere in the package is an error."""

import shutil
from pathlib import Path

import pytest

from nerfnav.core import kernel_cache
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import Kernel
from nerfnav.core.kernel_cache import PACKAGE, kernel_files, require_covered, sources_digest


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the library's sources."""
    return shutil.copytree(
        PACKAGE, tmp_path_factory.mktemp("copy") / "nerfnav", ignore=shutil.ignore_patterns("__pycache__", "*.npz")
    )


def digest_of(package: Path) -> str:
    kernel_files.cache_clear()
    return sources_digest(package)


def test_the_key_is_the_same_for_the_same_sources(package: Path) -> None:
    assert digest_of(package) == sources_digest()


@pytest.mark.parametrize("path", sorted(str(path.relative_to(PACKAGE)) for path in kernel_files()))
def test_an_edit_of_any_file_with_a_kernel_changes_the_key(path: str, package: Path) -> None:
    before, file = digest_of(package), package / path
    source = file.read_text()
    try:
        file.write_text(source.replace("@kernel(", "# edited\n@kernel(", 1))
        assert digest_of(package) != before
    finally:
        file.write_text(source)
    assert digest_of(package) == before


@pytest.mark.parametrize("path", ["field/core/protocol.py", "robots/arcs.py", "core/jit.py"])
def test_an_edit_of_constants_that_kernels_compile_in_changes_the_key(path: str, package: Path) -> None:
    before, file = digest_of(package), package / path
    source = file.read_text()
    try:
        file.write_text(source + "\n")
        assert digest_of(package) != before
    finally:
        file.write_text(source)


def test_a_new_kernel_anywhere_in_the_package_changes_the_key(package: Path) -> None:
    before, file = digest_of(package), package / "geometry" / "new_kernel.py"
    try:
        file.write_text("from nerfnav.core.jit import kernel\n\n\n@kernel()\ndef twice(x):\n    return 2 * x\n")
        assert digest_of(package) != before
    finally:
        file.unlink()


def test_an_edit_of_a_file_without_kernels_keeps_the_key(package: Path) -> None:
    before, file = digest_of(package), package / "core" / "memory.py"
    source = file.read_text()
    try:
        file.write_text(source + "\n")
        assert digest_of(package) == before
    finally:
        file.write_text(source)


def test_a_kernel_of_the_package_in_a_file_that_the_key_does_not_cover_is_an_error() -> None:
    outside = compile("lambda x: x", str(PACKAGE / "core" / "memory.py"), "eval")
    with pytest.raises(InvalidInputError, match="key of the kernel cache") as caught:
        Kernel(eval(outside), {"cache": True})(1.0)
    assert str(caught.value).count("nerfnav/core/memory.py") == 1 and "\n" not in str(caught.value)


def test_kernels_of_other_packages_are_not_asked_to_stand_in_covered_files() -> None:
    require_covered("mine", __file__)
    assert Path(kernel_cache.__file__) not in kernel_files()
