"""Who may look, who may command: names, origins and tokens."""

from __future__ import annotations

import pytest

from rig.panel.guard import HEADERS, Guard, authority, is_loopback

LOCAL = Guard("127.0.0.1", 8321, "operator-token", "viewer-token")
NETWORK = Guard("192.168.0.7", 8321, "operator-token", "viewer-token")
EVERYWHERE = Guard("0.0.0.0", 8321, "operator-token", "viewer-token")


@pytest.mark.parametrize(
    ("guard", "host", "allowed"),
    [
        (LOCAL, "127.0.0.1:8321", True),
        (LOCAL, "localhost:8321", True),
        (LOCAL, "LOCALHOST:8321", True),
        (LOCAL, "[::1]:8321", True),
        (LOCAL, "127.0.0.1", False),
        (LOCAL, "127.0.0.1:80", False),
        (LOCAL, "evil.example:8321", False),
        (LOCAL, "127.0.0.1.evil.example:8321", False),
        (LOCAL, "192.168.0.7:8321", False),
        (LOCAL, "", False),
        (LOCAL, None, False),
        (NETWORK, "192.168.0.7:8321", True),
        (NETWORK, "evil.example:8321", False),
        (EVERYWHERE, "10.0.0.3:8321", True),
        (EVERYWHERE, "[fe80::1]:8321", True),
        (EVERYWHERE, "evil.example:8321", False),
        (EVERYWHERE, "10.0.0.3:8321:8321", False),
    ],
)
def test_only_the_servers_own_names_are_answered(
    guard: Guard, host: str | None, allowed: bool
) -> None:
    assert guard.host_allowed(host) is allowed


@pytest.mark.parametrize(
    ("origin", "allowed"),
    [
        ("http://127.0.0.1:8321", True),
        ("https://127.0.0.1:8321", False),
        ("http://127.0.0.1:8322", False),
        ("http://localhost:8321", False),  # another origin than the one that was asked
        ("http://evil.example", False),
        ("null", False),
        (None, False),
    ],
)
def test_only_the_own_origin_is_allowed(origin: str | None, allowed: bool) -> None:
    assert LOCAL.origin_allowed(origin, "127.0.0.1:8321") is allowed


def test_on_loopback_everybody_looks_and_the_operator_commands() -> None:
    assert LOCAL.may_look(None)
    assert LOCAL.may_command("operator-token")
    for token in (None, "", "viewer-token", "operator-tokeN", "operator-tokén"):
        assert not LOCAL.may_command(token)


def test_over_a_network_looking_needs_a_token_too() -> None:
    assert not NETWORK.may_look(None)
    assert not NETWORK.may_look("guess", "guess")
    assert NETWORK.may_look("viewer-token")
    assert NETWORK.may_look("operator-token")
    assert NETWORK.may_look(None, cookie="viewer-token")
    # A cookie is sent along by the browser, so it must never give the right to command.
    assert not NETWORK.may_look(None, cookie="operator-token")
    assert not NETWORK.may_command("viewer-token")


def test_what_counts_as_loopback() -> None:
    assert [h for h in ("127.0.0.1", "127.9.9.9", "::1", "localhost") if not is_loopback(h)] == []
    assert [h for h in ("0.0.0.0", "192.168.0.7", "lab", "::") if is_loopback(h)] == []


def test_ipv6_addresses_stand_in_brackets() -> None:
    assert authority("::1", 80) == "[::1]:80"
    assert authority("127.0.0.1", 80) == "127.0.0.1:80"


def test_the_page_may_load_nothing_from_elsewhere() -> None:
    policy = HEADERS["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy
