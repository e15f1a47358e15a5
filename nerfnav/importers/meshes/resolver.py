"""Gazebo's models: model.config, meshes/ and, beside these, materials/textures/ or textures/."""

from pathlib import Path


def root_of(mesh: Path) -> Path:
    """The folder in which files may lie that a mesh names: its own, or the model's where that is its meshes/."""
    folder = mesh.resolve().parent
    model = folder.parent
    is_model = folder.name.lower() == "meshes" and (
        (model / "materials").is_dir() or (model / "model.config").is_file() or (model / "textures").is_dir()
    )
    return model if is_model else folder
