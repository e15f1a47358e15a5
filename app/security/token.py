"""Token: the secret that visitors of a server must bring."""

import re

from nerfnav.errors import NerfnavError
from nerfnav_app.security.address import is_loopback


class TokenError(NerfnavError):
    """A server that others can reach would have no token."""


def check_token(host: str, token: str | None) -> None:
    """Raise TokenError for a missing or unusable token; only a server that this machine alone reaches needs none."""
    if token is None and not is_loopback(host):
        raise TokenError(
            f"whoever reaches {host} could steer this app: give it a secret with --token, or serve at 127.0.0.1"
        )
    if token is not None and not re.fullmatch(r"[A-Za-z0-9._~-]+", token):
        raise TokenError("a token is made of letters, digits, '.', '_', '~' and '-', for it travels in addresses")
