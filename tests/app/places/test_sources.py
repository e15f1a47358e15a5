"""What visitors read never says where files lie."""

import pytest

from nerfnav_app.places.sources import without_paths
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state.session import Session


@pytest.mark.parametrize(
    ("text", "reported"),
    [
        ("cannot read /srv/app/x/mine.npz: it is torn", "cannot read mine.npz: it is torn"),
        ("[Errno 2] No such file: '/tmp/nerfnav-1/2/mine.npz'", "[Errno 2] No such file: 'mine.npz'"),
        ("~/fields/mine.npz and ../other/b.npz", "mine.npz and b.npz"),
        ("see https://example.org/a/b", "see https://example.org/a/b"),
        ("1/2 of it at 3 m/s", "1/2 of it at 3 m/s"),
    ],
)
def test_files_go_by_their_names(text: str, reported: str) -> None:
    assert without_paths(text) == reported


def test_notices_name_no_folders() -> None:
    reported = add_notice(Session.opening("balls"), "Something broke", "OSError: /root/.cache/nerfnav/x.npz", bad=True)
    assert reported.notices[-1].body == "OSError: x.npz"
