"""Checkpoints of nerf-pytorch: networks of every shape become the field that they were, and code is never run."""

import os
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import Tensor, nn

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.importers.core.placement import Placement
from nerfnav.importers.nerf.checkpoint import is_checkpoint
from nerfnav.importers.nerf.config import NerfPytorchConfig
from nerfnav.importers.nerf.importer import load_nerf_pytorch

BOX = Placement(box=((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0)))


def encoded(points: Tensor, count: int, include: bool = True) -> Tensor:
    parts = [points] if include else []
    for power in range(count):
        parts += [torch.sin(2.0**power * points), torch.cos(2.0**power * points)]
    return torch.cat(parts, -1)


class Flexible(nn.Module):
    """The network of krrish94 that most of its checkpoints hold, reported by its own forward pass."""

    def __init__(self, width: int, depth: int, skip: int, directions: bool) -> None:
        super().__init__()
        self.skips = [index for index in range(1, depth - 2) if index % skip == 0]
        self.layer1 = nn.Linear(39, width)
        self.layers_xyz = nn.ModuleList(
            nn.Linear(width + 39 * (index in self.skips), width) for index in range(depth - 1)
        )
        if directions:
            self.layers_dir = nn.ModuleList([nn.Linear(width + 24, width // 2)])
            self.fc_alpha, self.fc_feat = nn.Linear(width, 1), nn.Linear(width, width)
            self.fc_rgb = nn.Linear(width // 2, 3)
        else:
            self.fc_out = nn.Linear(width, 4)

    def forward(self, points: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
        gamma = encoded(points, 6)
        x = self.layer1(gamma)
        for index, layer in enumerate(self.layers_xyz):
            x = layer(torch.cat([x, gamma], -1) if index in self.skips else x).relu()
        if hasattr(self, "fc_out"):
            out = self.fc_out(x)
            return out[..., 3].relu(), out[..., :3].sigmoid()
        y = torch.cat([self.fc_feat(x).relu(), encoded(directions, 4, include=False)], -1)
        return self.fc_alpha(x)[..., 0].relu(), self.fc_rgb(self.layers_dir[0](y).relu()).sigmoid()


class Paper(nn.Module):
    """The other network of krrish94, whose density comes after the features."""

    def __init__(self) -> None:
        super().__init__()
        self.layers_xyz = nn.ModuleList(
            nn.Linear({0: 39, 4: 39 + 32}.get(index, 32), 32) for index in range(8)
        )
        self.fc_feat, self.fc_alpha, self.fc_rgb = nn.Linear(32, 32), nn.Linear(32, 1), nn.Linear(16, 3)
        self.layers_dir = nn.ModuleList([nn.Linear(32 + 27, 16), *(nn.Linear(16, 16) for _ in range(3))])

    def forward(self, points: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
        gamma = x = encoded(points, 6)
        for index, layer in enumerate(self.layers_xyz):
            x = layer(torch.cat([gamma, x], -1) if index == 4 else x).relu()
        features = self.fc_feat(x)
        y = torch.cat([features, encoded(directions, 4)], -1)
        for layer in list(self.layers_dir)[:3]:
            y = layer(y).relu()
        return self.fc_alpha(features)[..., 0].relu(), self.fc_rgb(y).sigmoid()


class Yen(nn.Module):
    """The network of yenchenlin."""

    def __init__(self) -> None:
        super().__init__()
        self.pts_linears = nn.ModuleList(nn.Linear({0: 63, 5: 63 + 32}.get(index, 32), 32) for index in range(8))
        self.views_linears = nn.ModuleList([nn.Linear(32 + 27, 16)])
        self.feature_linear, self.alpha_linear, self.rgb_linear = nn.Linear(32, 32), nn.Linear(32, 1), nn.Linear(16, 3)

    def forward(self, points: Tensor, directions: Tensor) -> tuple[Tensor, Tensor]:
        gamma = x = encoded(points, 10)
        for index, layer in enumerate(self.pts_linears):
            x = layer(x).relu()
            x = torch.cat([gamma, x], -1) if index == 4 else x
        y = self.views_linears[0](torch.cat([self.feature_linear(x), encoded(directions, 4)], -1)).relu()
        return self.alpha_linear(x)[..., 0].relu(), self.rgb_linear(y).sigmoid()


def saved(path: Path, network: nn.Module, fine: nn.Module | None = None, **settings: Any) -> Path:
    """A checkpoint as its project names its parts."""
    names = ("network_fn_state_dict", "network_fine_state_dict")
    if not isinstance(network, Yen):
        names = ("model_coarse_state_dict", "model_fine_state_dict")
    content = {"iter": 3, names[0]: network.state_dict()}
    if fine is not None:
        content[names[1]] = fine.state_dict()
    torch.save(content, path, **settings)
    return path


@pytest.mark.parametrize(
    "make",
    [
        lambda: Flexible(32, 4, 4, True),
        lambda: Flexible(32, 8, 3, True),
        lambda: Flexible(24, 5, 4, False),
        Paper,
        Yen,
    ],
    ids=["flexible", "flexible-with-skips", "flexible-without-directions", "paper", "yenchenlin"],
)
def test_the_imported_field_is_the_network(make: Callable[[], nn.Module], tmp_path: Path) -> None:
    torch.manual_seed(0)
    coarse, fine = make(), make()
    field = load_nerf_pytorch(saved(tmp_path / "a.ckpt", coarse, fine), NerfPytorchConfig(placement=BOX))
    points = torch.rand(50, 3) * 2 - 1
    directions = torch.nn.functional.normalize(torch.randn(50, 3), dim=-1)
    density, color = fine(points, directions)
    torch.testing.assert_close(field.density(points), density, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(field.radiance(points, directions), color, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(field.seen(field.coarse, points, directions)[0], coarse(points, directions)[0])


def test_scale_and_up_place_the_network_in_the_world(tmp_path: Path) -> None:
    torch.manual_seed(1)
    network = Flexible(32, 4, 4, True)
    placement = Placement(up=(0.0, 1.0, 0.0), scale=0.5, box=BOX.box)
    field = load_nerf_pytorch(saved(tmp_path / "a.ckpt", network), NerfPytorchConfig(placement=placement))
    above = torch.tensor([[0.1, 0.2, 0.4]])  # the file's y axis is up: (0.1, 0.4, -0.2) there, twice as many units
    there = 2 * torch.tensor([[0.1, 0.4, -0.2]])
    up, y = torch.tensor([[0.0, 0, 1]]), torch.tensor([[0.0, 1, 0]])
    torch.testing.assert_close(field.density(above), 2 * network(there, y)[0])  # per half a metre
    torch.testing.assert_close(field.radiance(above, up), network(there, y)[1])


def test_the_configuration_says_what_weights_cannot(tmp_path: Path) -> None:
    saved(tmp_path / "a5.ckpt", Flexible(32, 4, 4, True))
    saved(tmp_path / "a12.ckpt", Flexible(32, 4, 4, True))
    (tmp_path / "config.yml").write_text(
        "models: {fine: {num_layers: 8, hidden_size: 256}}\nnerf: {train: {white_background: false}}\n"
    )
    field = load_nerf_pytorch(tmp_path, NerfPytorchConfig(placement=BOX))
    assert field.info.source == "a12.ckpt" and field.background.tolist() == [0, 0, 0]
    assert (field.fine.config.depth, field.fine.config.width) == (4, 32)
    (tmp_path / "config.yml").write_text("dataset: {type: llff, no_ndc: false}\n")
    with pytest.raises(InvalidInputError, match="normalised device coordinates"):
        load_nerf_pytorch(tmp_path)
    assert is_checkpoint(tmp_path) and not is_checkpoint(tmp_path / "config.yml")


@pytest.mark.parametrize(
    ("config", "refused"),
    [
        ("dataset: {type: llff}\nmodels: {coarse: {type: FlexibleNeRFModel}, fine: {type: FlexibleNeRFModel}}\n", True),
        ("dataset: {type: LLFF, no_ndc: false}\nmodels: {fine: {type: PaperNeRFModel}}\n", True),
        ("dataset: {type: llff, no_ndc: true}\nmodels: {fine: {type: FlexibleNeRFModel}}\n", False),
        ("dataset: {type: blender}\nmodels: {fine: {type: FlexibleNeRFModel, no_ndc: false}}\n", False),
        ("dataset_type: llff\n", True),
        ("dataset_type: llff\nno_ndc: true\n", False),
    ],
)
def test_networks_of_normalised_device_coordinates_are_refused_wherever_the_configuration_says_so(
    config: str, refused: bool, tmp_path: Path
) -> None:
    saved(tmp_path / "a.ckpt", Flexible(32, 4, 4, True))
    (tmp_path / "config.yml").write_text(config)
    if refused:
        with pytest.raises(InvalidInputError, match="normalised device coordinates"):
            load_nerf_pytorch(tmp_path, NerfPytorchConfig(placement=BOX))
    else:
        assert load_nerf_pytorch(tmp_path, NerfPytorchConfig(placement=BOX)).fine.config.depth == 4


def test_evenly_spaced_frequencies_are_read_from_the_configuration(tmp_path: Path) -> None:
    saved(tmp_path / "a.ckpt", Flexible(32, 4, 4, True))
    (tmp_path / "config.yml").write_text("models: {coarse: {log_sampling_xyz: false, log_sampling_dir: true}}\n")
    shape = load_nerf_pytorch(tmp_path, NerfPytorchConfig(placement=BOX)).fine.config
    assert not shape.position.octaves and shape.direction is not None and shape.direction.octaves


class Evil:
    """A pickle that touches a file when it is loaded by somebody careless."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.mark),)


@pytest.mark.parametrize("zipped", [True, False])
def test_a_pickle_that_runs_code_is_refused_and_nothing_is_run(zipped: bool, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    file = tmp_path / "evil.ckpt"
    torch.save({"model_coarse_state_dict": Evil(mark)}, file, _use_new_zipfile_serialization=zipped)
    with pytest.raises(InvalidInputError, match="refused and nothing in it was run"):
        load_nerf_pytorch(file)
    assert not mark.exists()
    file.write_bytes(pickle.dumps(Evil(mark)))
    with pytest.raises(InvalidInputError, match="refused and nothing in it was run"):
        load_nerf_pytorch(file)
    assert not mark.exists()


def _cut(path: Path) -> None:
    saved(path, Flexible(32, 4, 4, True))
    path.write_bytes(path.read_bytes()[:2000])


def _cut_legacy(path: Path) -> None:
    saved(path, Flexible(32, 4, 4, True), _use_new_zipfile_serialization=False)
    path.write_bytes(path.read_bytes()[:-2000])


def _other_network(path: Path) -> None:
    torch.save({"model_coarse_state_dict": nn.Linear(3, 4).state_dict()}, path)


def _not_finite(path: Path) -> None:
    network = Flexible(32, 4, 4, True)
    network.layer1.weight.data[0, 0] = float("nan")
    saved(path, network)


@pytest.mark.parametrize(
    ("make", "reported"),
    [
        (lambda path: None, "there is no checkpoint"),
        (lambda path: path.write_bytes(b""), "is empty"),
        (lambda path: path.write_text("not weights, but words\n" * 40), "not a whole checkpoint"),
        (lambda path: path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(500)), "not a whole checkpoint"),
        (_cut, "not a whole checkpoint"),
        (_cut_legacy, "not a whole checkpoint"),
        (lambda path: torch.save({"weights": torch.ones(3)}, path), "holds no networks of nerf-pytorch"),
        (_other_network, "unknown shape"),
        (_not_finite, "not finite"),
    ],
)
def test_what_is_no_checkpoint_is_reported_in_one_sentence(
    make: Callable[[Path], object], reported: str, tmp_path: Path
) -> None:
    make(tmp_path / "a.ckpt")
    with pytest.raises(InvalidInputError, match=reported):
        load_nerf_pytorch(tmp_path / "a.ckpt")


def test_a_folder_without_a_checkpoint_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="holds no checkpoint"):
        load_nerf_pytorch(tmp_path)


@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA does not say where files are")
def test_the_lego_bulldozer_imports_and_renders() -> None:
    field = load_nerf_pytorch(Path(os.environ["NERFNAV_TEST_DATA"]) / "nerf_pytorch_lego")
    assert (field.fine.config.depth, field.fine.config.width) == (4, 128)
    assert field.box.size.max() < 2.8 and field.box.contains(torch.zeros(3))
    picture = render_image(field, Camera.from_fov(40, 40, 42), look_at(torch.tensor([2.4, -2.4, 2.0]), torch.zeros(3)))
    assert 0.25 < picture.opacity.mean() < 0.5
    solid = picture.color[picture.opacity > 0.9]
    red, _, blue = solid.unbind(-1)
    assert ((red > 0.6) & (blue < 0.35)).float().mean() > 0.25  # most of it is yellow
    assert (picture.color[0, :] > 0.98).all()  # before a white background
