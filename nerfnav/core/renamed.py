"""Renamed public names and options: one table, by which the old ones work for one more release, with a warning.

Public names are those on the faces of packages (`__init__.pyi`); `attach_face` makes a face that knows the table.
Remove an entry with the release after the one that renamed it.
"""

import warnings
from collections.abc import Callable, Sequence
from importlib import import_module

import lazy_loader

NAMES: dict[str, str] = {
    "nerfnav.estimator.ImuConfig": "nerfnav.inertial.ImuConfig",
    "nerfnav.estimator.ImuNoise": "nerfnav.inertial.ImuNoise",
    "nerfnav.estimator.LastingError": "nerfnav.estimator.ConsiderCovariance",
    "nerfnav.estimator.MeasuredNoise": "nerfnav.robots.MeasuredNoise",
    "nerfnav.estimator.ProcessNoise": "nerfnav.robots.ProcessNoise",
    "nerfnav.estimator.RandomAcceleration": "nerfnav.robots.RandomAcceleration",
    "nerfnav.estimator.Searcher": "nerfnav.estimator.GlobalLocalizer",
    "nerfnav.estimator.StateNoise": "nerfnav.robots.StateNoise",
    "nerfnav.estimator.comparable": "nerfnav.estimator.reduce_camera",
    "nerfnav.estimator.inertial_motion": "nerfnav.inertial.inertial_motion",
    "nerfnav.estimator.likeliest_floor": "nerfnav.estimator.fit_position_bias",
    "nerfnav.estimator.pose_floor": "nerfnav.estimator.measure_map_error",
    "nerfnav.estimator.remembered": "nerfnav.estimator.encode_views",
    "nerfnav.estimator.rescaled": "nerfnav.estimator.rescale_map_error",
    "nerfnav.estimator.resized": "nerfnav.estimator.resize_picture",
    "nerfnav.estimator.views_moved": "nerfnav.estimator.transform_views",
    "nerfnav.experiments.ExperimentStep": "nerfnav.experiments.TrialDone",
    "nerfnav.experiments.Freedom": "nerfnav.experiments.FreeSpaceAccuracy",
    "nerfnav.experiments.freedom_alone": "nerfnav.experiments.measure_unproven_share",
    "nerfnav.experiments.freedom_noted": "nerfnav.experiments.note_free_space",
    "nerfnav.experiments.freedom_on_depth": "nerfnav.experiments.measure_free_space_on_depth",
    "nerfnav.experiments.freedom_on_mesh": "nerfnav.experiments.measure_free_space_on_mesh",
    "nerfnav.experiments.in_words": "nerfnav.experiments.describe_free_space_accuracy",
    "nerfnav.export.unsafe": "nerfnav.export.explain_unsafe",
    "nerfnav.field.BakeStep": "nerfnav.field.EditStep",
    "nerfnav.field.MoveStep": "nerfnav.field.EditStep",
    "nerfnav.field.SightGrid": "nerfnav.field.RayGrid",
    "nerfnav.field.StateGrid": "nerfnav.field.OccupancyGrid",
    "nerfnav.field.Unknown": "nerfnav.field.UnknownSpace",
    "nerfnav.field.VoxelState": "nerfnav.field.Occupancy",
    "nerfnav.field.cropped": "nerfnav.field.crop_field",
    "nerfnav.field.glanced": "nerfnav.field.probe_rays",
    "nerfnav.field.levels_of": "nerfnav.field.build_levels",
    "nerfnav.field.moved": "nerfnav.field.move_field",
    "nerfnav.field.overlap": "nerfnav.field.intersect_boxes",
    "nerfnav.field.sight_grid_of": "nerfnav.field.get_ray_grid",
    "nerfnav.field.states_of": "nerfnav.field.classify_nodes",
    "nerfnav.field.unproven_in_words": "nerfnav.field.describe_unproven",
    "nerfnav.field.voxel_states": "nerfnav.field.compute_occupancy_grid",
    "nerfnav.geometry.before_tone_mapping": "nerfnav.geometry.invert_tone_map",
    "nerfnav.geometry.camera_of_matrices": "nerfnav.formats.parse_camera",
    "nerfnav.geometry.format_camera": "nerfnav.formats.format_camera",
    "nerfnav.geometry.outlines": "nerfnav.geometry.count_outside_silhouettes",
    "nerfnav.geometry.parse_camera": "nerfnav.formats.parse_camera",
    "nerfnav.geometry.picture_file": "nerfnav.geometry.encode_image",
    "nerfnav.geometry.read_camera": "nerfnav.formats.read_camera",
    "nerfnav.geometry.reduced": "nerfnav.geometry.downsample_image",
    "nerfnav.geometry.spiral": "nerfnav.geometry.fibonacci_directions",
    "nerfnav.geometry.tone_mapped": "nerfnav.geometry.tone_map",
    "nerfnav.geometry.with_neighbours": "nerfnav.geometry.dilate_nodes",
    "nerfnav.importers.Corrected": "nerfnav.importers.Alignment",
    "nerfnav.importers.Correction": "nerfnav.importers.AlignmentRequest",
    "nerfnav.importers.Imported": "nerfnav.importers.ImportedMesh",
    "nerfnav.importers.ONE_UNIT": "nerfnav.importers.UNIT_ASSUMED",
    "nerfnav.importers.capture_of_video": "nerfnav.importers.make_capture_of_video",
    "nerfnav.importers.corrected": "nerfnav.importers.compute_alignment",
    "nerfnav.importers.length_in_words": "nerfnav.importers.format_length",
    "nerfnav.importers.size_doubt": "nerfnav.importers.warn_implausible_size",
    "nerfnav.importers.splats_beside": "nerfnav.importers.splats_path",
    "nerfnav.importers.still_guessed": "nerfnav.importers.drop_answered_guesses",
    "nerfnav.importers.upright": "nerfnav.importers.place_splats",
    "nerfnav.importers.wrong_kind": "nerfnav.importers.wrong_kind_error",
    "nerfnav.navigation.LoopEvent": "nerfnav.navigation.FlightStep",
    "nerfnav.navigation.Mission": "nerfnav.navigation.FlightRequest",
    "nerfnav.navigation.Orders": "nerfnav.navigation.OperatorRequests",
    "nerfnav.navigation.Pilot": "nerfnav.navigation.NavigationStack",
    "nerfnav.navigation.Recovery": "nerfnav.navigation.SupervisorAction",
    "nerfnav.navigation.guarded": "nerfnav.navigation.build_safe_planner",
    "nerfnav.navigation.with_late_pictures": "nerfnav.navigation.compensate_latency",
    "nerfnav.planner.DangerMap": "nerfnav.planner.CollisionMap",
    "nerfnav.planner.Disturbance": "nerfnav.robots.NoiseModel",
    "nerfnav.planner.FollowingPlanner": "nerfnav.planner.InteractivePlanner",
    "nerfnav.planner.GOOD": "nerfnav.planner.FLYABLE",
    "nerfnav.planner.Outlook": "nerfnav.planner.RiskContext",
    "nerfnav.planner.PAPERS_NOISE": "nerfnav.robots.PAPER_NOISE",
    "nerfnav.planner.carry_on": "nerfnav.planner.replan_from",
    "nerfnav.planner.clearance_of": "nerfnav.planner.measure_clearance",
    "nerfnav.planner.honest": "nerfnav.planner.downgrade_outcome",
    "nerfnav.planner.last_step": "nerfnav.run_steps",
    "nerfnav.planner.safety_of": "nerfnav.planner.assess_safety",
    "nerfnav.planner.shortest_plan": "nerfnav.planner.find_shortest_plan",
    "nerfnav.planner.timing_of": "nerfnav.planner.estimate_timing",
    "nerfnav.planner.unfit_words": "nerfnav.planner.explain_unfit",
    "nerfnav.planner.way_length": "nerfnav.planner.path_length",
    "nerfnav.planner.within_chance": "nerfnav.planner.enforce_chance_constraint",
    "nerfnav.robots.Increments": "nerfnav.inertial.Increments",
    "nerfnav.robots.advanced": "nerfnav.inertial.integrate_step",
    "nerfnav.robots.decoded": "nerfnav.robots.decode_robot_file",
    "nerfnav.robots.described": "nerfnav.robots.describe_robot",
    "nerfnav.robots.known": "nerfnav.robots.is_known",
    "nerfnav.robots.moved_on": "nerfnav.inertial.propagate_state",
    "nerfnav.robots.of_kind": "nerfnav.robots.change_kind",
    "nerfnav.robots.unwrapped": "nerfnav.robots.unwrap_angles",
    "nerfnav.robots.wrapped": "nerfnav.robots.wrap_angle",
    "nerfnav.tracking.Inertial": "nerfnav.tracking.ImuMeasurements",
    "nerfnav.tracking.Tracked": "nerfnav.tracking.TrackedFrame",
    "nerfnav.world.moved_scene": "nerfnav.world.move_scene",
}
"""Old public name to the new one, each as `package.name`."""
OPTIONS: dict[str, str] = {
    "--config.": "--",
    "--risk": "--risk-weight",
    "--most-hits": "--most-risk",
    "--config.most-hits": "--most-risk",
}
"""Old option of the command line to the new one; a name that ends with a dot stands for all options below it."""


def attach_face(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """Make `__getattr__`, `__dir__` and `__all__` of a package from the `__init__.pyi` beside its `file`.

    Names are imported at first use (lazy_loader); old names give a DeprecationWarning that has the new name.
    """
    get_name, list_names, names = lazy_loader.attach_stub(package, file)

    def get_name_or_renamed(name: str) -> object:
        new = NAMES.get(f"{package}.{name}")
        if new is None:
            return get_name(name)
        message = f"{package}.{name} is now {new}: the next release removes the old name"
        warnings.warn(message, DeprecationWarning, stacklevel=2)
        home, _, attribute = new.rpartition(".")
        return getattr(import_module(home), attribute)

    return get_name_or_renamed, list_names, names


def replace_old_options(words: Sequence[str]) -> tuple[list[str], dict[str, str]]:
    """Replace old options in the words of a command line; return the new words, and old to new option for a warning."""
    options = [word.partition("=") for word in words]
    replaced = {
        option: new + option.removeprefix(old)
        for option, _, _ in options
        for old, new in OPTIONS.items()
        if option == old or (old.endswith(".") and option.startswith(old))
    }
    return [replaced.get(option, option) + equals + value for option, equals, value in options], replaced
