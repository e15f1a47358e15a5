"""Addresses are checked before a server is built."""

import socket
from collections.abc import Iterator

import pytest

from nerfnav_app.security.address import AddressError, check_address, is_loopback


@pytest.fixture
def taken_port() -> Iterator[int]:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen()
        yield listener.getsockname()[1]


def test_a_free_port_is_accepted_and_left_free() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    check_address("127.0.0.1", port)
    with socket.socket() as server:
        server.bind(("127.0.0.1", port))


def test_a_taken_port_is_refused_and_named(taken_port: int) -> None:
    with pytest.raises(AddressError, match=f"port {taken_port} of 127.0.0.1 is taken"):
        check_address("127.0.0.1", taken_port)


def test_a_port_taken_on_one_interface_is_refused_for_all_of_them(taken_port: int) -> None:
    with pytest.raises(AddressError, match="is taken"):
        check_address("0.0.0.0", taken_port)


@pytest.mark.parametrize("host", ["203.0.113.7", "no-such-host.invalid", "not a host"])
def test_a_host_that_is_no_interface_of_this_machine_is_refused(host: str) -> None:
    with pytest.raises(AddressError, match="no network interface"):
        check_address(host, 8080)


@pytest.mark.parametrize("port", [-1, 0, 65536])
def test_a_number_that_is_no_port_is_refused(port: int) -> None:
    with pytest.raises(AddressError, match="from 1 to 65535"):
        check_address("127.0.0.1", port)


def test_loopback_addresses_are_told_from_public_ones() -> None:
    assert is_loopback("127.0.0.1")
    assert is_loopback("localhost")
    assert not is_loopback("0.0.0.0")
    assert not is_loopback("203.0.113.7")
    assert not is_loopback("")
