"""`nerfnav fly` and `nerfnav experiment flights` as typed: contacts."""

from nerfnav.experiments import FlightOptions
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


def test_options_that_are_not_given_are_those_of_the_experiment() -> None:
    _, arguments = parse(["experiment", "replanning", "--robot", "crazyflie", "--risk-weight", "0"])
    assert _options(arguments) == FlightOptions("tasks", risk_weight=0, robot="crazyflie", fly_on=True)
    _, arguments = parse(["experiment", "flights", "--robot", "crazyflie"])
    assert _options(arguments) == FlightOptions(robot="crazyflie")
