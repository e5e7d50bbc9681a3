"""Addresses as people write them."""

import pytest

from app.addresses import as_written, client_of, host_and_port, is_loopback
from app.errors import ConfigurationError


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("127.0.0.1:5020", "127.0.0.1", 5020),
        ("[::1]:502", "::1", 502),
        ("plant.local:0", "plant.local", 0),
        ("0.0.0.0:65535", "0.0.0.0", 65535),
    ],
)
def test_host_and_port_are_taken_apart(text: str, host: str, port: int) -> None:
    assert host_and_port(text) == (host, port)


@pytest.mark.parametrize(
    "text",
    [
        *("", "5020", ":5020", "host", "host:", "host:x", "host:65536", "host:-1", "host:²", "host:٣"),
        *(
            "plc..hall:502",
            f"{'a' * 64}:502",
            ".:502",
            "a b:502",
            "http://plc:502",
            "[plc:502",
            "[]:502",
            "10.0.0.300:502",
        ),
    ],
)
def test_anything_else_is_told_what_was_expected(text: str) -> None:
    with pytest.raises(ConfigurationError, match="expected HOST:PORT"):
        host_and_port(text)


@pytest.mark.parametrize("text", ["plc.hall:502", "10.0.0.7:5020", "[::1]:5020", "[fe80::1]:502"])
def test_an_address_is_written_as_it_is_read(text: str) -> None:
    assert as_written(*host_and_port(text)) == text


@pytest.mark.parametrize(
    ("host", "local"),
    [
        ("localhost", True),
        ("127.0.0.1", True),
        ("127.8.8.8", True),
        ("::1", True),
        ("::ffff:127.0.0.1", True),
        ("::ffff:192.168.1.5", False),
        ("0.0.0.0", False),
        ("::", False),
        ("192.168.1.5", False),
        ("localhost.example", False),
        ("", False),
    ],
)
def test_only_what_leaves_the_machine_nowhere_is_loopback(host: str, local: bool) -> None:
    assert is_loopback(host) is local


@pytest.mark.parametrize(
    ("addresses", "client"),
    [
        (["192.0.2.7", "::ffff:192.0.2.7", "::ffff:c000:207"], "192.0.2.7"),
        (["2001:db8:0:1::1", "2001:db8:0:1:ffff:ffff:ffff:ffff", "2001:DB8:0:1::a%eth0"], "2001:db8:0:1::/64"),
        (["2001:db8:0:2::1"], "2001:db8:0:2::/64"),
        (["fe80::1", "fe80::2%3"], "fe80::/64"),
        (["127.0.0.1", "127.8.8.8", "::1", "::ffff:127.0.0.1"], "127.0.0.1"),
        (["testclient"], "testclient"),
        ([""], ""),
    ],
)
def test_what_one_client_may_have_of_addresses_counts_as_one(addresses: list[str], client: str) -> None:
    assert {client_of(address) for address in addresses} == {client}
