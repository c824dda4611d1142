"""Who may do what: a secret per role and run, exchanged for a cookie; whether a request is to us and from our pages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from secrets import compare_digest, token_urlsafe
from urllib.parse import urlsplit

from pipeline.live.events import Role

ROLES: tuple[Role, ...] = ("operator", "phone", "questionnaire")
LOOPBACK = ("127.0.0.1", "::1", "localhost")


def secret() -> str:
    """128 bits of chance, as text for an address."""
    return token_urlsafe(16)


@dataclass(frozen=True)
class Access:
    """The secrets of a run: `keys` are in addresses and codes, `tokens` in cookies; `sensors` is that of datagrams.

    Phones find the pages at `scheme`, `host` and `port`. With a `host` in a network they are on this computer by plain
    HTTP too, as a phone at a USB cable needs them, and the operator unless `operator_anywhere`. `language` is that of
    the participants' pages.
    """

    scheme: str
    host: str
    port: int
    operator_anywhere: bool = False
    language: str | None = None
    keys: Mapping[Role, str] = field(default_factory=lambda: {role: secret() for role in ROLES})
    tokens: Mapping[Role, str] = field(default_factory=lambda: {role: secret() for role in ROLES})
    sensors: str = field(default_factory=secret)

    @property
    def origin(self) -> str:
        """Where our pages come from."""
        return f"{self.scheme}://{self._netloc(self.host)}"

    def _netloc(self, host: str) -> str:
        return f"[{host}]:{self.port}" if ":" in host else f"{host}:{self.port}"

    @property
    def in_network(self) -> bool:
        """Whether other computers can open the pages."""
        return self.host not in LOOPBACK

    @property
    def origins(self) -> frozenset[str]:
        """Every origin of our pages."""
        on_this = "http" if self.in_network else self.scheme
        return frozenset({self.origin.lower(), *(f"{on_this}://{self._netloc(name)}" for name in LOOPBACK)})

    def address(self, role: Role) -> str:
        """The address that a page of that role is opened by, its key in it."""
        if role != "operator":
            language = f"?lang={self.language}" if self.language else ""
            return f"{self.origin}/join{language}#k={self.keys[role]}"
        elsewhere = self.operator_anywhere or not self.in_network
        origin = self.origin if elsewhere else f"http://{self._netloc(LOOPBACK[0])}"
        return f"{origin}/operator#k={self.keys[role]}"

    def is_our_host(self, host: str) -> bool:
        """Whether a request's Host header names us: no other name may lead here (DNS rebinding)."""
        return host.lower() in {urlsplit(origin).netloc for origin in self.origins}

    def is_our_origin(self, origin: str, host: str) -> bool:
        """Whether a request's Origin header is that of the page that it was sent to."""
        return origin.lower() in self.origins and urlsplit(origin).netloc.lower() == host.lower()

    def role_of_key(self, key: str, client: str) -> Role | None:
        """The role that a key opens, for a request from that address."""
        for role, known in self.keys.items():
            if compare_digest(known.encode(), key.encode()):
                return role if self._may_be(role, client) else None
        return None

    def cookie(self, role: Role) -> str:
        """The cookie's name."""
        return f"steadyhand-{role}-{self.port}"

    def is_let_in(self, role: Role, cookies: Mapping[str, str], client: str) -> bool:
        """Whether a request has a role's cookie, and comes from where the role may be."""
        given = cookies.get(self.cookie(role), "")
        return self._may_be(role, client) and compare_digest(given.encode(), self.tokens[role].encode())

    def _may_be(self, role: Role, client: str) -> bool:
        return role != "operator" or self.operator_anywhere or client in LOOPBACK
