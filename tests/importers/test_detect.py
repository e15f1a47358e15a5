"""One function says what a file or folder is, and every wrong kind is reported with what takes it."""

import json
import os
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import save_field
from nerfnav.formats import PICTURES
from nerfnav.geometry.box import Box
from nerfnav.importers.core.errors import WrongKindError, wrong_kind_error
from nerfnav.importers.core.kinds import UPLOADS, SourceKind, field_name
from nerfnav.importers.detect import source_kind
from nerfnav.importers.splats.formats import load_splats
from nerfnav.importers.splats.gaussians import save_splats
from tests.importers.captures.synthetic import write_transforms
from tests.importers.splat_files import bundle_sog, some_splats, write_inria, write_ksplat, write_sog, write_spz


def _mesh(path: Path) -> None:
    trimesh.creation.box().export(path)


def _field(path: Path) -> None:
    save_field(VoxelField(Box.of((0, 0, 0), (1, 1, 1)), torch.zeros(4, 4, 4, 4), torch.ones(3)), path)


def _truth(path: Path) -> None:
    np.savez(path, header=np.array(json.dumps({"format": "nerfnav-ground-truth", "version": 1})))


def _own_splats(path: Path) -> None:
    write_inria(path.with_suffix(".ply"), some_splats(5))
    save_splats(load_splats(path.with_suffix(".ply")), path)


def _zipped_mesh(path: Path) -> None:
    _mesh(path.with_suffix(".obj"))
    with zipfile.ZipFile(path, "w") as archive:
        archive.write(path.with_suffix(".obj"), "house/house.obj")


def _zipped_capture(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("room/transforms.json", "{}")
        archive.writestr("room/mesh.ply", "ply")


def _gazebo(folder: Path) -> None:
    (folder / "meshes").mkdir(parents=True)
    _mesh(folder / "meshes" / "house.obj")
    _mesh(folder / "meshes" / "house_collision.stl")
    (folder / "model.config").write_text("<model/>")


def _nerfstudio(folder: Path) -> None:
    folder.mkdir()
    (folder / "config.yml").write_text("!!python/object:nerfstudio.engine.trainer.TrainerConfig\ndata: null\n")
    (folder / "nerfstudio_models").mkdir()


def _with(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        folder.mkdir()
        (folder / name).write_bytes(b"{}")

    return make


CASES: tuple[tuple[str, Callable[[Path], object], SourceKind], ...] = (
    ("house.GLB", lambda path: path.touch(), SourceKind.MESH),
    ("house.obj", _mesh, SourceKind.MESH),
    ("house.ply", _mesh, SourceKind.MESH),
    ("house.zip", _zipped_mesh, SourceKind.MESH),
    ("model", _gazebo, SourceKind.MESH),
    ("moon.ply", lambda path: write_inria(path, some_splats(5)), SourceKind.SPLATS),
    ("moon.spz", lambda path: write_spz(path, some_splats(5)), SourceKind.SPLATS),
    ("moon.sog", lambda path: bundle_sog(path, some_splats(5)), SourceKind.SPLATS),
    ("moon.ksplat", lambda path: write_ksplat(path, some_splats(5)), SourceKind.SPLATS),
    ("moon", lambda path: write_sog(path, some_splats(5)), SourceKind.SPLATS),
    ("moon.splats.npz", _own_splats, SourceKind.SPLATS),
    ("room", write_transforms, SourceKind.CAPTURE),
    ("room.zip", _zipped_capture, SourceKind.CAPTURE),
    ("phone.r3d", _zipped_capture, SourceKind.CAPTURE),
    ("run", _nerfstudio, SourceKind.CAPTURE),
    ("walk.MOV", lambda path: path.touch(), SourceKind.VIDEO),
    ("net.ckpt", lambda path: path.touch(), SourceKind.NERF),
    ("nets", _with("a.tar"), SourceKind.NERF),
    ("field.npz", _field, SourceKind.FIELD),
    ("field.truth.npz", _truth, SourceKind.TRUTH),
    ("flight", _with("run.json"), SourceKind.FLIGHT),
    ("plan", _with("plan.json"), SourceKind.PLAN),
    ("view.png", lambda path: path.touch(), SourceKind.PICTURE),
    ("words.txt", lambda path: path.write_text("words"), SourceKind.UNKNOWN),
    ("other", _with("notes.txt"), SourceKind.UNKNOWN),
)


@pytest.mark.parametrize(("name", "make", "kind"), CASES, ids=[name for name, *_ in CASES])
def test_every_kind_of_file_and_folder_is_reported(
    name: str, make: Callable[[Path], object], kind: SourceKind, tmp_path: Path
) -> None:
    make(tmp_path / name)
    assert source_kind(tmp_path / name, ("stonehenge",)) is kind


def test_names_of_scenes_come_first_and_what_is_not_there_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "stonehenge").mkdir()
    assert source_kind("stonehenge", ("stonehenge",)) is SourceKind.SCENE
    assert source_kind("stonehenge") is SourceKind.UNKNOWN
    assert source_kind("atlantis.glb") is SourceKind.MISSING


@pytest.mark.parametrize(
    ("name", "kind", "reported"),
    [
        ("house.glb", SourceKind.MESH, "is a mesh, and a field is asked for: `nerfnav train house.glb"),
        ("moon.spz", SourceKind.SPLATS, "`nerfnav import moon.spz --out moon.npz` makes a field of it"),
        ("walk.mp4", SourceKind.VIDEO, "`nerfnav train walk.mp4 --out walk.npz` makes a field of it"),
        ("net.ckpt", SourceKind.NERF, "`nerfnav import net.ckpt --out net.npz` makes a field of it"),
        ("view.png", SourceKind.PICTURE, "`nerfnav localize FIELD view.png`"),
        ("flight", SourceKind.FLIGHT, "`nerfnav export flight"),
        ("a.truth.npz", SourceKind.TRUTH, "open the field beside it, a.npz"),
        ("gone.glb", SourceKind.MISSING, "there is no file or folder gone.glb"),
    ],
)
def test_the_right_command_is_named_for_a_wrong_kind(name: str, kind: SourceKind, reported: str) -> None:
    error = wrong_kind_error(name, kind, "a field")
    assert isinstance(error, WrongKindError) and reported in str(error) and "\n" not in str(error)


def test_what_is_of_no_kind_is_reported_by_its_first_bytes(tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(b"\x89PNG\r\n\x1a\n")
    assert "is not a field: it is a PNG picture" in str(
        wrong_kind_error(tmp_path / "a.bin", SourceKind.UNKNOWN, "a field")
    )
    (tmp_path / "b.jpg").touch()
    assert "a folder of pictures without poses" in str(wrong_kind_error(tmp_path, SourceKind.UNKNOWN, "a field"))


@pytest.mark.parametrize("suffix", [*UPLOADS, *PICTURES])
def test_a_pointer_of_git_lfs_is_none_of_the_kinds_that_its_ending_says(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n")
    with pytest.raises(InvalidInputError, match=rf"^{path} is a pointer of Git LFS .*`git lfs pull`\)$"):
        source_kind(path)


def test_fields_are_called_as_their_sources(tmp_path: Path) -> None:
    assert field_name("a/guitar.compressed.ply") == "guitar.npz"
    assert field_name(tmp_path / "playbot" / "meta.json") == "playbot.npz"
    (tmp_path / "v1.2 room").mkdir()
    assert field_name(tmp_path / "v1.2 room") == "v1.2 room.npz"


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("fox", SourceKind.CAPTURE),
        ("lego", SourceKind.CAPTURE),
        ("redkitchen", SourceKind.CAPTURE),
        ("redkitchen/transforms.json", SourceKind.CAPTURE),
        ("warehouse.glb", SourceKind.MESH),
        ("stonehenge_chronos.glb", SourceKind.MESH),
        ("nerf_pytorch_lego", SourceKind.NERF),
        ("splats/biker.spz", SourceKind.SPLATS),
        ("splats/playbot_sog", SourceKind.SPLATS),
        ("splats/three_points.ply", SourceKind.SPLATS),
    ],
)
@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA does not say where files are")
def test_files_of_other_programs_are_reported(name: str, kind: SourceKind) -> None:
    assert source_kind(Path(os.environ["NERFNAV_TEST_DATA"]) / name) is kind
