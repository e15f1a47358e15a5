"""How well a place is learned from pictures or a mesh, and how long a page lets one wait for that."""

from typing import Literal

QualityName = Literal["draft", "good", "best"]
"""Names of nerfnav_app.jobs.training_data.quality.QUALITIES."""
USUAL: QualityName = "good"
BUDGETS_S: dict[QualityName, float] = {"draft": 20.0, "good": 60.0, "best": 240.0}
"""Time that is spent on learning a field in the page [s]: the usual one is enough to fly in, and short enough to wait
for."""
