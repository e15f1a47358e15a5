"""Tests mirror the tree. `check` is what pytest's jaxtyping option checks types and shapes of nerfnav with."""

from tests.shape_checks import check as check
from tests.shape_checks import use

use()
