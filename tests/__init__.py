"""Tests mirror the tree. `check` is what pytest's jaxtyping option checks types and shapes of nerfnav with."""

from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
"""beartype, with integers welcome where floats are asked for."""
