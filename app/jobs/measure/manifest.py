"""Manifest of an experiment's folder: what its numbers depend on, written before the first trial and never changed.

A command that continues an experiment compares its own manifest with that of the folder, and is refused where they
differ. Version, commit and machine are for the reader; the digest of the code decides.
"""

import hashlib
import json
import os
import platform
import subprocess
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import msgspec
import numba
import numpy as np
import torch
from filelock import Timeout

import nerfnav
import nerfnav_scenes
from nerfnav.core.cache import hash_code
from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.formats import read_record
from nerfnav_app import benchmarks
from nerfnav_app.storage.output_files import OutputError, json_line, prepare_folder, write_text
from nerfnav_app.storage.step_log import lock_for

MANIFEST, TRIALS, RESULTS = "manifest.json", "results.jsonl", "results.json"
"""Files of each folder: what is asked, the trials that have ended, and the results."""


class Manifest(msgspec.Struct, frozen=True):
    """Settings and inputs of an experiment."""

    experiment: str
    """Name of the experiment."""
    settings: dict[str, Any]
    """Settings by name, as JSON has them."""
    inputs: dict[str, str]
    """Digest (SHA-256) of each field and robot file, by its name."""
    hash: str
    """Digest of name, settings and inputs."""
    version: str
    """Version of nerfnav."""
    code: str
    """Digest of its code: equal code gives equal numbers."""
    commit: str | None
    """Commit of a checkout, with -dirty where it was changed; None for an installed package."""
    machine: dict[str, Any]
    """Machine of the first trial."""


def make_manifest(experiment: str, settings: Mapping[str, Any], files: Mapping[str, Path]) -> Manifest:
    """Describe an experiment on this machine; `files` are its inputs by name. Raises NerfnavError for missing ones."""
    stated, inputs = json.loads(json_line(dict(settings))), {name: _digest(path) for name, path in files.items()}
    code = hash_code(*(Path(package.__path__[0]) for package in (nerfnav, nerfnav_scenes, benchmarks)))
    return Manifest(
        experiment, stated, inputs, _hash(experiment, stated, inputs), nerfnav.__version__, code.hex(), _commit(),
        describe_machine(),
    )  # fmt: skip


def _digest(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise InvalidInputError(f"{path} cannot be read: {error.strerror}") from error


def _hash(*content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _commit() -> str | None:
    root = Path(nerfnav.__path__[0]).parent
    if not (root / ".git").exists():
        return None
    words = ["git", "-C", str(root), "describe", "--always", "--dirty", "--exclude=*", "--abbrev=12"]
    try:
        return subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def describe_machine() -> dict[str, Any]:
    """Collect what times depend on: system, processor, cores, versions of the libraries that compute."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "system": platform.platform(),
        "processor": models[0] if models else platform.processor() or platform.machine(),
        "cores": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count(),
        "python": platform.python_version(),
        "torch": str(torch.__version__),
        "numpy": np.__version__,
        "numba": numba.__version__,
    }


@contextmanager
def open_folder(folder: Path, manifest: Manifest) -> Iterator[Manifest]:
    """Take a folder for an experiment inside the block, new or to be continued; return the manifest that it has.

    Raises OutputError where it cannot be written to or another process does, InvalidInputError where it holds
    something else or its manifest is damaged.
    """
    path = prepare_folder(folder) / MANIFEST
    lock = lock_for(path)
    try:
        lock.acquire()
    except Timeout as error:
        raise OutputError(f"another process writes into {folder}: wait for it, or give another folder") from error
    except OSError as error:
        raise OutputError(f"cannot write into the folder {folder}: {error.strerror}") from error
    try:
        there = manifest
        if not _is_begun(folder):  # a request that was refused before its first trial leaves a manifest alone
            write_text(path, json.dumps(msgspec.to_builtins(manifest), indent=1) + "\n")
        elif not path.exists():
            raise InvalidInputError(f"{folder} holds results without {MANIFEST}: give another folder")
        elif reason := _difference(there := _read(path), manifest):
            raise InvalidInputError(f"{folder} {reason}: give another folder")
        yield there
    finally:
        Path(lock.lock_file).unlink(missing_ok=True)
        lock.release()


def _is_begun(folder: Path) -> bool:
    """Check whether a folder holds trials or results, of one experiment or of several in folders of their own."""
    return any((folder / name).exists() for name in (TRIALS, RESULTS)) or any(folder.glob(f"*/{MANIFEST}"))


def _read(path: Path) -> Manifest:
    try:
        manifest, _ = read_record(path, Manifest)
    except NerfnavError as error:
        raise InvalidInputError(f"{error}; give another folder") from error
    if manifest.hash != _hash(manifest.experiment, manifest.settings, manifest.inputs):
        raise InvalidInputError(f"{path} was changed after it was written: give another folder")
    return manifest


def _difference(there: Manifest, here: Manifest) -> str | None:
    """End of a sentence on the first difference; None where the numbers will be the same."""
    if there.experiment != here.experiment:
        return f"holds the experiment {there.experiment}, not {here.experiment}"
    for name in {**there.settings, **here.settings}:
        before, now = (manifest.settings.get(name) for manifest in (there, here))
        if before != now:
            return f"was begun with {name} {_shown(before)}, not {_shown(now)}"
    for name in {**there.inputs, **here.inputs}:
        if there.inputs.get(name) != here.inputs.get(name):
            return f"was begun with another file of {name}"
    if there.version != here.version:
        return f"was begun by version {there.version}, not {here.version}"
    return "was begun by other code of the same version" if there.code != here.code else None


def _shown(value: Any) -> str:
    return "by default" if value is None else json.dumps(value).strip('"')
