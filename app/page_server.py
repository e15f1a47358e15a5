"""The viser server that the page is on: behind the guard of security/, with the page's name and limits."""

import viser

from nerfnav_app.page.kit.theme import branded
from nerfnav_app.places.uploads import MOST_BYTES
from nerfnav_app.security.address import check_address
from nerfnav_app.security.guarded_server import PagePolicy, guarded_server


def page_server(host: str, port: int, token: str | None = None) -> viser.ViserServer:
    """The server at `host`:`port`, listening; hosts that other machines reach must have a token.

    Raises NerfnavError where it cannot listen there, or must not without a token.
    """
    check_address(host, port)
    return guarded_server(host, port, token, PagePolicy(branded, MOST_BYTES))
