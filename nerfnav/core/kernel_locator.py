"""Cache locator of numba for kernels: the place of their machine code in `kernel_cache.cache_folder`.

numba's own folders are named after the path of the source: every clone and every environment would compile all
kernels anew. The folder here is named after their content already, so that all with the same kernels share it. This
module is apart from `kernel_cache` because it imports numba.
"""

from pathlib import Path
from typing import Any

from numba.core.caching import UserProvidedCacheLocator

from nerfnav.core.kernel_cache import PACKAGE, kernel_files


class KernelLocator(UserProvidedCacheLocator):
    """Locator (numba's word) of kernels of this package; others are left to numba's own."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        """Name the folder for the modules of one folder, the same wherever the package is installed."""
        return "_".join(Path(py_file).parent.relative_to(PACKAGE).parts)

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> Any:
        """Make the locator of a function; None outside nerfnav, whose own kernels `Kernel` has checked."""
        return super().from_function(py_func, py_file) if Path(py_file) in kernel_files() else None
