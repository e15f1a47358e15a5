"""nerfnav open: the browser app with anything that can be opened; another name of `nerfnav serve`.

It opens the page in this machine's browser, too.
"""

from dataclasses import dataclass

from nerfnav_app.cli.commands import serve


@dataclass(frozen=True)
class Arguments(serve.Arguments):
    """Open anything in the browser: a scene, a field, a mesh, a capture, splats, a video, a trained NeRF."""

    open: bool = True
    """Open the page in this machine's browser."""


run = serve.run
