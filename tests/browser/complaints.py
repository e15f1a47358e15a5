"""What pages complain of: errors on their console, and exceptions that nobody caught."""

from playwright.sync_api import BrowserContext, ConsoleMessage, WebError

EXPECTED = {
    "WebSocket connection to": "a server that a test has stopped is not there any more",
    "WebSocket is already in CLOSING or CLOSED state": "the same, while something was being sent",
    "Failed to load resource: net::ERR_FILE_NOT_FOUND (blob:": "viser takes a picture back that was not loaded yet",
    "THREE.BufferGeometry.computeBoundingSphere(): Computed radius is NaN": "viser's splats are flat",
}
"""Beginnings of complaints that are none, with the reason."""


def complaints_of(context: BrowserContext) -> list[str]:
    """The complaints of all pages of `context` from now on; the list grows as they come."""
    complaints: list[str] = []

    def note(text: str) -> None:
        if not any(text.startswith(start) for start in EXPECTED):
            complaints.append(text)

    def said(message: ConsoleMessage) -> None:
        if message.type == "error":
            note(f"{message.text} ({message.location['url'][:200]})")

    def broke(error: WebError) -> None:
        note(str(error.error))

    context.on("console", said)
    context.on("weberror", broke)
    return complaints
