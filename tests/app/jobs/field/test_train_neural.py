"""`nerfnav train --field neural`: the paper's own kind of field, from the same material."""

import json
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.storage.checkpoint import load_field
from nerfnav_app.cli import main as cli
from nerfnav_app.jobs.field.request import NeuralOptions


@pytest.mark.slow
def test_a_scene_becomes_a_neural_field(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "blocks.npz"
    words = "train blocks --field neural --layers 2 --layer-width 16 --rays 32 --iterations 20 --images 10 --json"
    assert cli.main([*words.split(), "--out", str(out)]) == 0
    reported = json.loads(capsys.readouterr().out)
    field = load_field(out)
    assert isinstance(field, NeuralField) and field.fine.config.width == 16
    assert field.info.source == "blocks" and field.info.iterations == 20
    assert reported["voxels"] is None and reported["psnr_db"] == field.info.psnr_db is not None
    assert reported["file_bytes"] == out.stat().st_size


def test_networks_that_cannot_be_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="device is cpu or cuda"):
        NeuralOptions(device="tpu")
    with pytest.raises(InvalidInputError, match="layers must be"):
        NeuralOptions(layers=0)
