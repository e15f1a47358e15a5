"""Errors for developers who name a scene that does not exist, or has no field."""

import pytest

from nerfnav_scenes import measure, prove
from nerfnav_scenes.named import for_named


@pytest.mark.parametrize("command", [measure.main, prove.main])
@pytest.mark.parametrize(("name", "says"), [("nowhere", "no scene named 'nowhere'"), ("blocks", "no field file")])
def test_a_wrong_name_is_refused_in_one_sentence(
    command: object, name: str, says: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", ["scenes", name])
    with pytest.raises(SystemExit) as ended:
        for_named(command)  # type: ignore[arg-type]
    text = capsys.readouterr().err
    assert ended.value.code == 2 and says in text and text.count("\n") == 1


def test_without_a_name_it_is_done_for_all_that_have_a_field(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["scenes"])
    asked: list[str] = []
    for_named(asked.extend)
    assert sorted(asked) == ["apartment", "church", "playground", "stonehenge"]
