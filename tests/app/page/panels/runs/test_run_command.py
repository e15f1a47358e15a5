"""A stored run shows the command that flies it again."""

from pathlib import Path

from nerfnav_app.page.panels.runs.runs import describe
from nerfnav_app.storage.run_store import RunStore
from tests.app.storage.stored_runs import put


def test_a_run_shows_its_command_escaped_and_what_it_leaves_out(tmp_path: Path) -> None:
    shelf = RunStore(tmp_path)
    put(shelf, "plain", command="nerfnav fly 'a <b>.npz' --seed 3")
    put(shelf, "blown", command="nerfnav fly stonehenge", requests=("a gust", "another goal"))
    put(shelf, "old")
    plain, blown, old = (describe(shelf.entry(name)) for name in ("plain", "blown", "old"))
    assert "nerfnav fly &#x27;a &lt;b&gt;.npz&#x27; --seed 3</code>" in plain and "user-select: all" in plain
    assert "without what was asked for on the way: a gust, another goal" in blown
    assert "<code" not in old
