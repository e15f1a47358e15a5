"""Theme of the app: one colour for each meaning, the title bar, the light."""

import base64
import re
from importlib.resources import files

import numpy as np
import viser
from viser.theme import TitlebarConfig, TitlebarImage

from nerfnav.geometry import to_linear

Rgb = tuple[int, int, int]

# pairwise distinct, for deuteranopes too, and from the axes of viser's gizmos: see tests/app/page/kit/test_theme.py
BRAND: Rgb = (81, 56, 243)
START: Rgb = (75, 208, 198)
GOAL: Rgb = (212, 26, 191)
PLAN: Rgb = (250, 230, 60)
STALE: Rgb = (121, 126, 133)
TRUTH: Rgb = (0, 214, 255)
BELIEF: Rgb = (240, 120, 0)
CANDIDATE: Rgb = (205, 180, 255)
HIT: Rgb = (228, 68, 60)
CAUTION: Rgb = (245, 170, 40)
"""Of texts alone: what is neither good nor bad."""
GUST: Rgb = (255, 255, 240)
OTHER_TRUTH: Rgb = (196, 236, 255)
OTHER_PLAN: Rgb = (255, 246, 180)
CLEARANCE_CM = (0.0, 20.0)
"""Clearance at the two ends of the scale [cm]; more than that is well clear."""
SCALE: tuple[Rgb, ...] = ((255, 245, 140), (250, 155, 50), (205, 95, 130), (95, 105, 235))
"""Low to high: the less clearance the brighter, from yellow by orange to blue, distinct for deuteranopes too."""
MUTED = "light-dark(#5a6070, #9aa0ae)"
"""Of secondary text."""
_NIGHT_TOP: Rgb = (38, 43, 56)
_NIGHT_BOTTOM: Rgb = (13, 15, 21)
_SKY: Rgb = (226, 232, 245)
_GROUND: Rgb = (120, 118, 112)
_SKYLIGHT = 2.0  # beside the lamp of viser, which has 3


def linear(color: Rgb | np.ndarray) -> np.ndarray:
    """Convert sRGB bytes to linear bytes: viser takes arrays of colours as linear."""
    return np.round(255 * to_linear(np.asarray(color, dtype=np.float64) / 255)).astype(np.uint8)


def on_scale(shares: np.ndarray) -> np.ndarray:
    """Map shares (n,) of the scale, 0 to 1, to colours (n, 3) in sRGB bytes, clamped at its ends."""
    stops = np.linspace(0, 1, len(SCALE))
    rows = [np.interp(shares, stops, channel) for channel in zip(*SCALE, strict=True)]
    return np.round(np.stack(rows, -1)).astype(np.uint8)


def css(color: Rgb) -> str:
    """Format a colour as CSS."""
    return "#{:02x}{:02x}{:02x}".format(*color)


def readable(color: Rgb) -> str:
    """Format a colour as CSS for text: darker where panels are light."""
    return f"light-dark(color-mix(in srgb, {css(color)} 60%, black), {css(color)})"


def branded(page: bytes) -> bytes:
    """Brand viser's page: the app's name, icon, style, help and scripts (page.*, picks.js, software_gl.js)."""
    page = page.replace(b"<title>Viser</title>", b"<title>nerfnav</title>", 1)
    icon = b'<link rel="icon" href="' + _data_url("favicon.svg").encode() + b'" />'
    page = re.sub(rb'<link\s+rel="icon"[^>]*?/?>', lambda _: icon, page, count=1)
    style, body, script = (_beside(f"page.{ending}") for ending in ("css", "html", "js"))
    parts = (_beside("software_gl.js"), script, _beside("picks.js"))
    scripts = b"".join(b"<script>" + each + b"</script>" for each in parts)
    own = b"<style>" + style + b"</style>" + body + scripts
    before, end, after = page.rpartition(b"</body>")
    return before + own + end + after


def _beside(name: str) -> bytes:
    """Read a file of the package `page`."""
    return (files("nerfnav_app.page") / name).read_bytes()


def _data_url(image: str) -> str:
    """Encode a picture of the package `page` as a data URL."""
    return "data:image/svg+xml;base64," + base64.b64encode(_beside(image)).decode()


def apply_theme(server: viser.ViserServer) -> None:
    """Give the page its theme, title bar and backdrop."""
    apply_brightness(server, light=False)
    # viser's own width: another one is lost where a window was once as narrow as a phone
    server.gui.main_panel.dock_right()
    server.scene.configure_default_lights(enabled=True, cast_shadow=False)
    # not by a picture of the surroundings, which a browser without a graphics card needs seconds to prepare
    server.scene.configure_environment_map(hdri=None)
    server.scene.add_light_hemisphere("/sky", sky_color=_SKY, ground_color=_GROUND, intensity=_SKYLIGHT)
    server.scene.set_background_image(night(), format="png")


def apply_brightness(server: viser.ViserServer, light: bool) -> None:
    """Make panels and title bar light or dark; the backdrop of the scene stays as it is."""
    day, night = (_data_url(f"logo{of}.svg") for of in ("_light", ""))
    image = TitlebarImage(image_url_light=day, image_url_dark=night, image_alt="nerfnav", href=None)
    server.gui.configure_theme(
        titlebar_content=TitlebarConfig(buttons=None, image=image),
        dark_mode=not light,
        show_logo=False,
        show_share_button=False,
        brand_color=BRAND,
    )


def night(rows: int = 256) -> np.ndarray:
    """Draw the dark gradient behind the scene, (rows, rows, 3) bytes."""
    share = np.linspace(0, 1, rows)[:, None, None]
    column = (1 - share) * np.array(_NIGHT_TOP) + share * np.array(_NIGHT_BOTTOM)
    return np.round(np.broadcast_to(column, (rows, rows, 3))).astype(np.uint8)
