"""How the app looks: one colour for each meaning, the title bar, the light."""

import base64
import re
from importlib.resources import files

import numpy as np
import viser
from viser.theme import TitlebarConfig, TitlebarImage

from nerfnav.geometry import to_linear

Rgb = tuple[int, int, int]

BRAND: Rgb = (99, 102, 241)
START: Rgb = (52, 211, 153)
GOAL: Rgb = (244, 114, 182)
PLAN: Rgb = (70, 84, 255)
STALE: Rgb = (120, 124, 138)
TRUTH: Rgb = (0, 214, 255)
BELIEF: Rgb = (255, 140, 0)
CANDIDATE: Rgb = (255, 214, 102)
HIT: Rgb = (248, 72, 72)
OTHER_TRUTH: Rgb = (196, 236, 255)
OTHER_PLAN: Rgb = (158, 165, 255)
MUTED = "#9aa0ae"
"""Of secondary text."""
_NIGHT_TOP: Rgb = (38, 43, 56)
_NIGHT_BOTTOM: Rgb = (13, 15, 21)
_SKY: Rgb = (226, 232, 245)
_GROUND: Rgb = (120, 118, 112)
_SKYLIGHT = 2.0  # beside the lamp of viser, which has 3

_PANEL_WIDTH = 340.0  # [pixels]


def linear(color: Rgb | np.ndarray) -> np.ndarray:
    """sRGB bytes as linear bytes: what viser wants where it takes an array of colours."""
    return np.round(255 * to_linear(np.asarray(color, dtype=np.float64) / 255)).astype(np.uint8)


def css(color: Rgb) -> str:
    """The colour as CSS has it."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def branded(page: bytes) -> bytes:
    """viser's page under the app's name and with its icon."""
    page = page.replace(b"<title>Viser</title>", b"<title>nerfnav</title>", 1)
    icon = b'<link rel="icon" href="' + _data_url("favicon.svg").encode() + b'" />'
    return re.sub(rb'<link\s+rel="icon"[^>]*?/?>', lambda _: icon, page, count=1)


def _data_url(image: str) -> str:
    """A picture that lies beside this file."""
    return "data:image/svg+xml;base64," + base64.b64encode((files("app.page") / image).read_bytes()).decode()


def apply_theme(server: viser.ViserServer) -> None:
    """Give the page its theme, title bar and backdrop."""
    logo = _data_url("logo.svg")
    image = TitlebarImage(image_url_light=logo, image_url_dark=logo, image_alt="nerfnav", href=None)
    server.gui.configure_theme(
        titlebar_content=TitlebarConfig(buttons=None, image=image),
        dark_mode=True,
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND,
    )
    server.gui.main_panel.dock_right()
    server.gui.main_panel.set_width(_PANEL_WIDTH)
    server.scene.configure_default_lights(enabled=True, cast_shadow=False)
    # not by a picture of the surroundings, which a browser without a graphics card needs seconds to prepare
    server.scene.configure_environment_map(hdri=None)
    server.scene.add_light_hemisphere("/sky", sky_color=_SKY, ground_color=_GROUND, intensity=_SKYLIGHT)
    server.scene.set_background_image(night(), format="png")


def night(rows: int = 256) -> np.ndarray:
    """A still, dark gradient behind the scene."""
    share = np.linspace(0, 1, rows)[:, None, None]
    column = (1 - share) * np.array(_NIGHT_TOP) + share * np.array(_NIGHT_BOTTOM)
    return np.round(np.broadcast_to(column, (rows, rows, 3))).astype(np.uint8)
