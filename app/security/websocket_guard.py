"""Guard of websockets: servers that are built while it is open refuse whom the policy refuses."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import websockets.asyncio.server
from websockets.http11 import Request, Response

from nerfnav_app.security.access import AccessPolicy
from nerfnav_app.security.message_filter import LARGEST_FRAME, MOST_WAITING, MessageFilter

_patching = threading.Lock()
Responder = Callable[[Any, Request], Response | None]


@contextmanager
def guarding(access: AccessPolicy, message_filter: MessageFilter) -> Iterator[None]:
    """While open, servers of `websockets` are built behind `access` and `message_filter`."""
    build = websockets.asyncio.server.serve

    def build_guarded(handler: Any, *args: Any, process_request: Responder, **options: Any) -> Any:
        def respond(connection: Any, request: Request) -> Response | None:
            refusal = access.refusal(request)
            return refusal if refusal is not None else access.welcome(request, process_request(connection, request))

        options |= {"max_size": LARGEST_FRAME, "max_queue": MOST_WAITING}
        return build(message_filter.before(handler), *args, process_request=respond, **options)

    with _patching:
        websockets.asyncio.server.serve = build_guarded  # type: ignore[assignment]
        try:
            yield
        finally:
            websockets.asyncio.server.serve = build
