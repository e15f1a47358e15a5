"""Prove again what is free in the fields of the bundled worlds, by depth maps from where their pictures were taken.

    python -m nerfnav_scenes.prove stonehenge church

Nothing is learned: the fields remain what pictures alone have taught, as in the paper. But no colours prove the air
before the church's plastered walls, and the worlds are known, so that depth maps of the same cameras say what is free.
Cameras follow from a field's seed. Fields are replaced in trained/.
"""

import sys
from dataclasses import replace
from pathlib import Path

import torch

import nerfnav_scenes as scenes
from nerfnav.core.steps import run_steps
from nerfnav.experiments import (
    FreeSpaceAccuracy,
    describe_free_space_accuracy,
    measure_free_space_on_mesh,
    note_free_space,
)
from nerfnav.field import VoxelField, classify_nodes, load_field, save_field
from nerfnav.field.proof.fusion import fuse_depth
from nerfnav.geometry import PosedImages
from nerfnav.world import CaptureConfig, Scene, images_taken, split
from nerfnav.world.capture import capture
from nerfnav_scenes.named import for_named


def learned_from(field: VoxelField, scene: Scene) -> PosedImages:
    """The pictures that a field of a bundled scene was learned from, taken again, with depth."""
    config = CaptureConfig(images=images_taken(field.info.images)).suiting(scene)
    return split(run_steps(capture(scene, config, torch.Generator().manual_seed(field.info.seed))))[0]


def proven(field: VoxelField, scene: Scene, photographs: PosedImages) -> VoxelField:
    """The field with what depth maps prove, and with what planners then take for free."""
    states = classify_nodes(fuse_depth(photographs, field.box, field.shape).free, field.values[..., 0])
    info = replace(field.info, learned_from="pictures", proven_from="depth")
    known = replace(field, evidence=states, info=info)
    accuracy = measure_free_space_on_mesh(known, field.resolution, scene, photographs.camera, photographs.poses)
    return replace(known, info=note_free_space(known.info, accuracy))


def main(names: list[str]) -> None:
    """Do so for the fields of some scenes."""
    for name in names:
        path, scene = scenes.trained_path(name), scenes.load(name)
        field = load_field(path)
        assert isinstance(field, VoxelField), "bundled worlds have voxel fields"
        known = proven(field, scene, learned_from(field, scene))
        size = save_field(known, Path(path))
        info = known.info
        accuracy = FreeSpaceAccuracy(info.surface_taken_for_free, info.free_taken_for_free, info.unproven_share, 0.0)
        sys.stdout.write(f"{name}: {describe_free_space_accuracy(accuracy)}; {size / 1e6:.1f} MB\n")


if __name__ == "__main__":
    for_named(main)
