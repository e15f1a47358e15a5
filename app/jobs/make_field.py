"""Make a field of a file that somebody brings, so that it can be opened: a mesh, a capture, splats, a NeRF."""

from pathlib import Path

from app.jobs import import_field, train
from app.jobs.events import JobEvents
from app.jobs.import_field import ImportRequest
from app.jobs.train import TrainRequest

BUDGET_S = 60.0
"""Time that is spent on learning a field [s]: enough to fly in, short enough to wait for."""


def run(source: Path, out: Path) -> JobEvents:
    """Yield what training or importing yields, and leave the field in `out`; NeRFs are baked, to be quick."""
    if import_field.imports(source):
        return import_field.run(ImportRequest(source, out, bake=True))
    return train.run(TrainRequest(str(source), out, budget=BUDGET_S))
