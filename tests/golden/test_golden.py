"""Golden files are read as they were written, written as they were read, and computed again as they were computed."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.golden import contracts, exports, places, runs, stored
from tests.golden import product as p

FIELDS = (*places.FIELDS, "room", "voxel_version1", "voxel_version2")
STRICT, CLOSE = (0.0, 0.0), (1e-5, 1e-6)
"""Relative and absolute tolerance of numbers: as they are stored, and as they are computed of what is stored."""


def equal(golden: Any, now: Any, tolerance: tuple[float, float] = STRICT) -> None:
    """Fail with a line for each of the first things that differ."""
    found = runs.differences(golden, json.loads(json.dumps(now)), tolerance)
    assert not found, "\n".join(found[:20])


@pytest.fixture(scope="module")
def room() -> Any:
    """The room as its file has it."""
    return p.load_field(stored.FIELDS / "room.npz")


# Fields


ADDED = {
    "made_by": "", "attitude_floor_rad": None, "information_ratio": None, "failed_share": None, "input_keys": None
}  # fmt: skip
"""What fields say since the golden ones were written, which do not have it, and what is told of those."""


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_is_read_as_it_was_written(name: str) -> None:
    told = stored.field_told(stored.FIELDS / f"{name}.npz")
    assert {key: told["told"]["info"].pop(key) for key in ADDED} == ADDED
    equal(stored.read("fields.json")[name], told)


@pytest.mark.parametrize("name", (*places.FIELDS, "room"))
def test_a_field_is_written_again_with_the_same_header_and_the_same_arrays(name: str, tmp_path: Path) -> None:
    path = stored.FIELDS / f"{name}.npz"
    p.save_field(p.load_field(path), tmp_path / "again.npz")
    with np.load(path) as golden, np.load(tmp_path / "again.npz") as again:
        header = json.loads(str(again["header"]))
        assert {key: header["info"].pop(key) for key in ADDED} == ADDED
        assert list(json.loads(str(golden["header"])).items()) == list(header.items())
        assert sorted(again.files) == sorted(golden.files)
        for part in sorted({*golden.files} - {"header"}):
            assert again[part].dtype == golden[part].dtype
            np.testing.assert_array_equal(again[part], golden[part])


@pytest.mark.parametrize("name", places.FIELDS)
def test_a_golden_field_says_everything_that_a_field_can_say_and_nothing_that_is_usual(name: str) -> None:
    usual = runs.plain(p.FieldInfo())
    header, arrays = stored.stored_arrays(stored.FIELDS / f"{name}.npz")
    assert list(header["info"]) == [key for key in usual if key not in ADDED]
    assert [key for key, value in header["info"].items() if value == usual[key]] == []
    assert name == "neural" or {"outside_raw", "outside_color", "evidence"} <= arrays.keys()


def test_there_is_a_golden_field_for_each_codec() -> None:
    formats = {stored.stored_arrays(stored.FIELDS / f"{name}.npz")[0]["format"] for name in places.FIELDS}
    assert formats == set(p.CODECS)


def test_what_an_earlier_version_did_not_write_is_not_known_now() -> None:
    told = p.load_field(stored.FIELDS / "voxel_version1.npz")
    assert told.outside is None and told.evidence is None
    assert told.info.camera == () and told.info.position_floor_m is None and told.info.psnr_db == 31.25


def test_the_ground_truth_beside_a_field_is_read_as_it_was_written_and_written_again_alike() -> None:
    field = p.load_field(stored.FIELDS / "voxel.npz")
    scene = p.load_truth(stored.FIELDS / field.info.truth, field.info.truth_sha256)
    golden, arrays = stored.read("truth.json"), p.arrays_of_truth(scene)
    assert json.loads(str(arrays.pop("header"))) == golden["header"]
    # textures are PNG, which other libraries pack: their pixels are compared
    images = {name for name in arrays if name.startswith("image_") and name != "image_of_face"}
    equal(
        {name: told for name, told in golden["arrays"].items() if name not in images},
        {name: p.digest_of(array) for name, array in arrays.items() if name not in images},
    )
    assert scene.paint is not None and images == {"image_0"}
    np.testing.assert_array_equal(scene.paint.images[0], places.truth_scene().paint.images[0])


# Flights, plans, experiments on disk


@pytest.mark.parametrize("name", ["flight", "outcomes"])
def test_a_stored_flight_is_read_as_it_was_written(name: str) -> None:
    equal(stored.read("runs.json")[name], stored.run_told(stored.RUNS / name), CLOSE)


@pytest.mark.parametrize("name", ["flight", "outcomes"])
def test_each_step_of_a_stored_flight_is_written_again_letter_by_letter(name: str) -> None:
    folder = stored.RUNS / name
    lines = (folder / "steps.jsonl").read_text().splitlines()
    steps = p.read_steps(folder)
    assert len(lines) == len(steps)
    for line, step in zip(lines, steps, strict=True):
        picture = None if step.image is None else f"pictures/{step.index:05}.jpg"
        assert json.dumps(p.encode_step(step) | {"picture": picture}) == line


@pytest.mark.parametrize("name", ["flight", "outcomes"])
def test_what_is_known_of_a_flight_is_written_again_letter_by_letter(name: str, tmp_path: Path) -> None:
    written = p.RunMetadata.load(stored.RUNS / name).save(tmp_path)
    added = {"command": None, "requests": [], "plan_outcome": None}  # which flights of earlier versions do not have
    assert json.loads(written.read_text()) == json.loads((stored.RUNS / name / "run.json").read_text()) | added


LATER = {p.EpisodeOutcome.OUTSIDE, p.EpisodeOutcome.LOST, p.SupervisorAction.LANDED}
"""Outcomes and actions that there were not when the golden flights were written."""


def test_the_store_lists_the_golden_flights_with_their_outcomes_and_steps() -> None:
    entries = {entry.name: (entry.outcome, entry.steps) for entry in p.RunStore(stored.RUNS).entries()}
    assert entries == {
        "flight": ("collided", len(p.SupervisorAction) + 3),
        "outcomes": ("stopped", len(p.EpisodeOutcome) - len(LATER)),
    }


def test_the_golden_flights_hold_every_recovery_and_every_outcome() -> None:
    recoveries = [step.recovery for step in p.read_steps(stored.RUNS / "flight")]
    outcomes = [step.outcome for step in p.read_steps(stored.RUNS / "outcomes")]
    assert set(recoveries) == {None, *p.SupervisorAction} - LATER
    assert outcomes == [outcome for outcome in p.EpisodeOutcome if outcome not in LATER]


def test_a_step_that_does_not_say_whether_it_was_late_was_not(tmp_path: Path) -> None:
    shutil.copytree(stored.RUNS / "flight", tmp_path / "flight")
    log = tmp_path / "flight" / "steps.jsonl"
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert [line.pop("late") for line in lines].count(True) == 2
    log.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert not any(step.late for step in p.read_steps(tmp_path / "flight"))


def test_an_episode_is_written_again_as_it_was_read(tmp_path: Path) -> None:
    folder = stored.RUNS / "flight"
    numbers, words = p.Episode.load(folder).save(tmp_path)
    golden, now = (json.loads(path.read_text()) for path in (folder / "episode.json", words))
    now = runs.without_later_numbers(now)
    assert now.keys() == golden.keys()
    equal(golden, now, CLOSE)
    assert stored.stored_arrays(numbers) == stored.stored_arrays(folder / "episode.npz")


def test_an_episode_on_disk_is_that_of_its_steps() -> None:
    folder = stored.RUNS / "flight"
    of_steps, loaded = p.Episode.of(p.read_steps(folder)), p.Episode.load(folder)
    equal(runs.plain(of_steps), runs.plain(loaded), CLOSE)


@pytest.mark.parametrize("name", ["plan", "runs/flight"])
def test_a_table_is_written_again_letter_by_letter(name: str) -> None:
    text = (stored.DATA / name / "trajectory.json").read_text()
    table = p.table_of_json(text)
    assert p.json_text(table) == text
    assert p.csv_text(table) == (stored.DATA / name / "trajectory.csv").read_text()


def test_the_numbers_of_a_plan_are_written_again_letter_by_letter() -> None:
    text = (stored.DATA / "plan" / "plan.json").read_text()
    assert p.json_line(json.loads(text)) + "\n" == text


def test_a_stored_experiment_is_read_as_it_was_written() -> None:
    equal(stored.read("experiment.json"), stored.experiment_told())


def test_the_results_of_an_experiment_are_written_again_letter_by_letter(tmp_path: Path) -> None:
    folder = stored.RUNS / "experiments" / stored.EXPERIMENT
    told = json.loads((folder / "results.json").read_text())
    results = p.Results(told["summary"], tuple(told["rows"]))
    written = p.save_results(tmp_path, told["experiment"], results, {"basin": (folder / "basin.png").read_bytes()})
    assert sorted(path.name for path in written) == sorted(path.name for path in folder.iterdir())
    for path in written:
        assert path.read_bytes() == (folder / path.name).read_bytes(), path.name


# Places, robots, sessions


def test_a_kept_place_is_read_as_it_was_written(tmp_path: Path) -> None:
    folder = shutil.copytree(stored.PLACES, tmp_path / "places")
    equal(stored.read("places.json"), stored.places_told(folder))


def test_a_kept_place_is_written_again_letter_by_letter(tmp_path: Path) -> None:
    folder = shutil.copytree(stored.PLACES, tmp_path / "places")
    (entry,) = p.PlaceLibrary(folder).entries()
    about = folder / entry.key / "place.json"
    before = about.read_bytes()
    about.unlink()
    p.write_place(entry)
    assert about.read_bytes() == before


def test_what_is_brought_again_is_found_in_the_folder_that_it_had(tmp_path: Path) -> None:
    (golden,) = p.PlaceLibrary(stored.PLACES).entries()
    library = p.PlaceLibrary(tmp_path)
    source = library.keep("A room (1).npz", Path(golden.what).read_bytes())
    assert source.relative_to(tmp_path) == Path(golden.what).relative_to(stored.PLACES)
    robot = p.keep_robot(library, stored.ROBOTS / "settee.yaml")
    assert [robot.relative_to(tmp_path).as_posix()] == stored.read("places.json")["robots"]
    assert robot.read_bytes() == (stored.PLACES / robot.relative_to(tmp_path)).read_bytes()


@pytest.mark.parametrize("name", places.ROBOTS)
def test_a_robot_file_is_read_as_it_was_written_and_describes_itself_again(name: str, tmp_path: Path) -> None:
    golden = stored.read("robots.json")["files"][name]
    equal(golden, stored.robot_told(stored.ROBOTS / f"{name}.yaml"), CLOSE)
    shutil.copytree(stored.ROBOTS, tmp_path, dirs_exist_ok=True)
    (tmp_path / "again.yaml").write_text(golden["yaml"])
    equal(golden, stored.robot_told(tmp_path / "again.yaml"), CLOSE)


@pytest.mark.parametrize("name", p.robots.ROBOTS)
def test_a_bundled_robot_is_what_it_was(name: str) -> None:
    equal(stored.read("robots.json")["bundled"][name], p.numbers_of_robot(p.robots.load(name)), CLOSE)


def test_a_session_is_read_and_written_again_letter_by_letter() -> None:
    file = p.session_file(stored.SESSIONS, places.SESSION_OF)
    assert json.loads(file.read_text()) == places.SESSION
    assert p.session_of(stored.SESSIONS, places.SESSION_OF) == file.read_bytes()


def _leaves(value: Any, path: tuple[str, ...] = ()) -> list[tuple[str, ...]]:
    if not isinstance(value, dict):
        return [path]
    return [leaf for key, part in value.items() for leaf in _leaves(part, (*path, key))]


@pytest.mark.parametrize("path", _leaves(places.SESSION), ids=".".join)
def test_no_value_of_the_golden_session_is_one_that_is_taken_where_none_is_said(
    path: tuple[str, ...], tmp_path: Path
) -> None:
    content = json.loads(json.dumps(places.SESSION))
    inner = content
    for key in path[:-1]:
        inner = inner[key]
    del inner[path[-1]]
    p.session_file(tmp_path, places.SESSION_OF).write_text(json.dumps(content))
    again = p.session_of(tmp_path, places.SESSION_OF)
    assert again is None or json.loads(again) != places.SESSION


# Plans and flights


@pytest.fixture(scope="module")
def computed() -> dict[str, dict[str, Any]]:
    """All plans and flights as they are computed now."""
    return runs.computed()


@pytest.mark.slow
@pytest.mark.parametrize("name", runs.plan_requests())
def test_a_plan_is_made_again_step_by_step(name: str, computed: dict[str, dict[str, Any]]) -> None:
    same = runs.arithmetic() == stored.read("arithmetic.json")
    found = runs.differences_of_plans(stored.read("plans.json")[name], computed["plans"][name], same)
    assert not found, "\n".join(found[:20])


@pytest.mark.slow
@pytest.mark.parametrize("name", runs.flight_requests())
def test_a_flight_is_flown_again_step_by_step(name: str, computed: dict[str, dict[str, Any]]) -> None:
    same = runs.arithmetic() == stored.read("arithmetic.json")
    found = runs.differences_of_flights(stored.read("flights.json")[name], computed["flights"][name], same)
    assert not found, "\n".join(found[:20])


@pytest.mark.parametrize("kind", ["plans", "flights"])
def test_a_golden_number_that_is_changed_is_noticed(kind: str) -> None:
    judge = {"plans": runs.differences_of_plans, "flights": runs.differences_of_flights}[kind]
    for golden in stored.read(f"{kind}.json").values():
        changed = json.loads(json.dumps(golden))
        assert judge(golden, changed, True) == [] and judge(golden, changed, False) == []
        if kind == "plans":
            changed["iterations"][-1]["total"] *= 1 + 1e-5
        else:
            changed["steps"][-1]["truth"]["position"][0] += 1e-4
        assert len(judge(golden, changed, True)) == 1
        if kind == "plans":
            changed["iterations"][0]["control"] *= 1.01
        else:
            changed["steps"][0]["truth"]["position"][0] += 0.01
        assert len(judge(golden, changed, False)) == 1


# Exports


@pytest.mark.parametrize("title", ["flight", "plan", "plan without a field"])
def test_each_export_has_the_same_bytes_as_it_had(title: str, room: Any) -> None:
    found = exports.recordings(stored.DATA, room)
    recording = found[title]
    golden, same = stored.read("exports.json")[title], runs.arithmetic() == stored.read("arithmetic.json")
    assert list(golden) == list(exports.wanted(recording))
    for name, form in exports.wanted(recording).items():
        exported = exports.exported(found, title, form)
        kept = stored.EXPORTS / f"{title}.{name}.{form.ending}".replace(" ", "_")
        equal(golden[name]["info"], runs.plain(exported.info), CLOSE)
        if not same and kept.is_file():
            assert exports.same_text(kept.read_bytes(), exported.content), name
            continue
        if kept.is_file():
            assert exported.content == kept.read_bytes(), name
        parts = {part: exports.digest(found) for part, found in exports.parts_of(name, exported.content).items()}
        if not same:  # another processor rounds the last bits of numbers in binary messages: their sizes are compared
            assert exports.sizes_of(parts) == exports.sizes_of(golden[name]["parts"]), name
            continue
        assert parts == golden[name]["parts"], name
        packed = exports.packed_by(name, exported.content)
        versions = {key: value for key, value in packed.items() if key != "sha256"}
        if versions.items() <= golden[name]["packed"].items():
            assert packed == golden[name]["packed"], name


def test_maps_and_tracks_have_the_same_bytes_as_they_had(tmp_path: Path) -> None:
    golden = {
        path.relative_to(stored.EXPORTS).as_posix(): path.read_bytes()
        for folder in ("maps", "tracks")
        for path in (stored.EXPORTS / folder).iterdir()
    }
    found = exports.others(stored.DATA, tmp_path)
    assert sorted(found) == sorted(golden)
    if runs.arithmetic() == stored.read("arithmetic.json"):
        assert found == golden
    assert [name for name, content in found.items() if not exports.same_text(golden[name], content)] == []


def test_the_last_digit_of_a_number_is_overlooked_on_other_machines_and_nothing_else() -> None:
    assert exports.same_text(b"a,1.2345678,x\n", b"a,1.2345679,x\n")
    for other in (b"a,1.2346678,x\n", b"b,1.2345678,x\n", b"a,1.2345678,x", b"a,1.2345678,x\n1"):
        assert not exports.same_text(b"a,1.2345678,x\n", other)


@pytest.mark.parametrize("message", places.MESSAGES, ids=lambda message: message["type"])
def test_a_message_of_a_vehicle_or_its_server_is_read_and_written_again_letter_by_letter(message: Any) -> None:
    text = json.dumps(message, separators=(",", ":"))
    assert p.resaid(text) == (text, text)


def test_every_export_format_is_golden_for_a_flight() -> None:
    assert set(stored.read("exports.json")["flight"]) == set(p.FORMATS)


# Contracts


@pytest.mark.parametrize("title", contracts.commands())
def test_each_subcommand_has_the_options_that_it_had(title: str) -> None:
    golden = stored.read("cli_options.json")[title]
    now = {p.new_option(option): told | {"names": [p.new_option(name) for name in told["names"]]}
           for option, told in golden.items()}  # fmt: skip
    equal(now, contracts.options_of(title))


@pytest.mark.parametrize("title", contracts.commands())
def test_all_options_that_a_subcommand_had_are_taken_together_with_their_defaults(title: str) -> None:
    golden = stored.read("cli_options.json")[title]
    usual, all_said = contracts.words_with(title, {}), contracts.words_with(title, golden)
    assert p.told_of(p.parse(all_said)[1]) == p.told_of(p.parse(usual)[1])


@pytest.mark.parametrize("title", contracts.commands())
def test_each_flag_that_a_subcommand_had_and_each_example_of_a_value_still_changes_something(title: str) -> None:
    usual = contracts.words_with(title, {})
    before = p.told_of(p.parse(usual)[1])
    for option, told in stored.read("cli_options.json")[title].items():
        if told["flag"] or "example" in told:
            assert p.told_of(p.parse([*usual, option, *told.get("example", [])])[1]) != before, option


@pytest.mark.slow
def test_each_choice_of_an_option_is_taken() -> None:
    for title, golden in stored.read("cli_options.json").items():
        for option, told in golden.items():
            for choice in (told["choices"] or []) if told["names"] else []:
                p.parse([*contracts.words_with(title, {}), option, choice])


def test_enums_have_the_names_and_the_values_that_they_had() -> None:
    equal(stored.read("enums.json"), contracts.enums())


def test_what_is_chosen_by_name_is_called_as_it_was() -> None:
    equal(stored.read("registered.json"), contracts.registered())


@pytest.mark.slow
def test_commands_print_the_names_that_they_printed(tmp_path: Path) -> None:
    golden = stored.read("json_keys.json")
    commands = contracts.commands_with_json(stored.FIELDS, tmp_path)
    assert list(golden) == list(commands)
    for name, words in commands.items():
        equal(golden[name], contracts.keys(p.printed_by_main(words)))
