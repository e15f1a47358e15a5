"""Registry of the terms of J (paper Eq. 2), one file for each: every planner, judge and report reads this list.

A term of your own is a `CostTerm`. `register` adds it to all problems that are made from then on; to add it to one
problem alone, give that one `terms=(*terms.list_terms(), mine)`.
"""

from nerfnav.core.registry import Registry
from nerfnav.planner.terms.collision import COLLISION
from nerfnav.planner.terms.control import CONTROL
from nerfnav.planner.terms.limits import LIMITS
from nerfnav.planner.terms.outside import OUTSIDE
from nerfnav.planner.terms.risk import RISK
from nerfnav.planner.terms.term import CostTerm

TERMS: Registry[CostTerm] = Registry("cost term", (COLLISION, CONTROL, LIMITS, OUTSIDE, RISK))
"""Terms by name."""


def register(term: CostTerm) -> None:
    """Count a term in every J from now on. Raises NameTakenError where another one has its name."""
    TERMS.register(term)


def unregister(name: str) -> None:
    """Count a term no longer. Raises UnknownNameError where there is none of that name."""
    TERMS.unregister(name)


def list_terms() -> tuple[CostTerm, ...]:
    """Return all terms that count."""
    return tuple(TERMS.values())
