"""`nerfnav fly` and `nerfnav experiment flights` as typed: contacts."""

from nerfnav_app.cli.commands.experiment import _options
from nerfnav_app.cli.main import parse


def test_a_contact_ends_a_flight_unless_it_is_told_to_fly_on() -> None:
    for words, flies_on in ((["fly", "stonehenge"], False), (["fly", "stonehenge", "--fly-on"], True)):
        _, arguments = parse(words)
        assert arguments.fly_on is flies_on


def test_flights_of_an_experiment_are_told_alike() -> None:
    _, arguments = parse(["experiment", "flights"])
    assert _options(arguments) is None
    _, arguments = parse(["experiment", "flights", "--fly-on"])
    options = _options(arguments)
    assert options is not None and options.fly_on
