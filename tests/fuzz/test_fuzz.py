"""Damaged inputs of each kind end in success or in one sentence that names the file, and change nothing.

The seed is the date: each day tries others. NERFNAV_FUZZ_SEED repeats those of a failure, which names it.
"""

import os
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from tests.fuzz.forks import Finding, Forks
from tests.fuzz.kinds import KINDS

SEED = int(os.environ.get("NERFNAV_FUZZ_SEED") or datetime.now(UTC).strftime("%Y%m%d"))
USUAL, NIGHTLY, AT_ONCE = 20, 2000, 100
"""Damaged inputs of a kind, by day and by night, and how many of them between two looks at the time limit."""


_SHARING = ("colmap", "field", "robot", "camera", "bag", "video")
"""Kinds of inputs whose variants have the damaged inputs by day together: each run of theirs takes longer."""


@pytest.fixture(scope="module")
def forks(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Forks]:
    started = Forks(tmp_path_factory.mktemp("fuzz"))
    yield started
    started.close()


def share_of(kind: str, count: int) -> int:
    """Return how many inputs of a variant are tried: those of `_SHARING` kinds have `count` together, others each."""
    family = kind.partition("-")[0]
    return -(-count // sum(other.partition("-")[0] == family for other in KINDS)) if family in _SHARING else count


def report(findings: list[Finding]) -> str:
    listed = "\n".join(finding.as_text for finding in findings)
    return f"{len(findings)} findings, repeat them with NERFNAV_FUZZ_SEED={SEED}\n{listed}"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_damaged_inputs_end_in_one_sentence(kind: str, forks: Forks) -> None:
    findings = forks.run(kind, SEED, share_of(kind, USUAL))
    assert not findings, report(findings)


@pytest.mark.nightly
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("kind", KINDS)
def test_many_damaged_inputs_end_in_one_sentence(kind: str, forks: Forks) -> None:
    findings: list[Finding] = []
    for part in range(NIGHTLY // AT_ONCE):
        findings += forks.run(kind, SEED * 1000 + part, AT_ONCE)
    assert not findings, report(findings)
