"""Bake: make a voxel field of any field."""

from collections.abc import Generator
from pathlib import Path

from nerfnav.core.errors import require_positive
from nerfnav.core.steps import map_steps
from nerfnav.field import BakeConfig, Field, StoredField, VoxelField, save_field
from nerfnav.field.edit.bake import bake
from nerfnav_app.jobs.events import JobEvent, JobEvents, JobResult, Progress
from nerfnav_app.jobs.field.report import import_numbers
from nerfnav_app.storage.output_files import prepare_file


def bake_file(source: StoredField, voxel: float | None, out: Path) -> JobEvents:
    """Bake a field and store the result: yield progress, and return the numbers."""
    require_positive(voxel=voxel)
    prepare_file(out)
    baked = yield from bake_field(source, voxel)
    return JobResult({**import_numbers(baked), "file_bytes": save_field(baked, out)}, (out,))


def bake_field(source: Field, voxel: float | None) -> Generator[JobEvent, bool | None, VoxelField]:
    """Bake a field, yield progress, and return the result."""
    return map_steps(bake(source, BakeConfig(voxel=voxel)), lambda step: Progress(step.label, step.fraction))
