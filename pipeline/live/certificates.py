"""The certificates of a live study in a lab's network: an authority of this computer's own, and one for its address.

Phones give motion, and connect by WebSocket, to pages of a certificate that they trust only. No public authority signs
for a private address, so this computer is one itself: its certificate is installed on the lab's phones once, and signs
for private addresses alone (a name constraint), so that it can speak for nobody else even if its key is stolen.

Apple takes leaves of up to 398 days (support.apple.com/HT211025) with a subject alternative name and `serverAuth`.
"""

from __future__ import annotations

import ipaddress
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import PipelineError

if TYPE_CHECKING:
    from cryptography.hazmat.primitives.asymmetric.ec import EllipticCurvePrivateKey
    from cryptography.x509 import Certificate, GeneralName, Name

_AUTHORITY, _LEAF, _KEY = "authority.crt", "{address}.crt", "{name}.key"
_AUTHORITY_DAYS, _LEAF_DAYS = 3650, 397
_RENEWED_DAYS = 30  # before a leaf's end
_EARLY = timedelta(days=1)  # phones' clocks differ
_PRIVATE = (
    "10.0.0.0/8",
    "172.16.0.0/12",
    "192.168.0.0/16",
    "100.64.0.0/10",
    "169.254.0.0/16",
    "127.0.0.0/8",
    "fc00::/7",
    "fe80::/10",
    "::1/128",
)
_PRIVATE_NAMES = ("localhost", "local")


@dataclass(frozen=True)
class Certificates:
    """The files of a server: its certificate and key, and our authority's certificate, None where we did not sign."""

    certificate: Path
    key: Path
    authority: Path | None = None

    def fingerprint(self) -> str:
        """The authority's SHA-256, to be compared with what a phone shows; "" where it is the lab's own."""
        from cryptography import x509
        from cryptography.hazmat.primitives.hashes import SHA256

        if self.authority is None:
            return ""
        return x509.load_pem_x509_certificate(self.authority.read_bytes()).fingerprint(SHA256()).hex(":").upper()


def usual_folder() -> Path:
    """Where this user's authority is kept."""
    if sys.platform == "win32":
        base = Path(os.environ.get("APPDATA") or Path.home())
    else:
        base = Path(os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config")
    return base / "steadyhand" / "authority"


def is_private(address: str) -> bool:
    """Whether our authority may sign for an address."""
    found = ipaddress.ip_address(address)
    return any(found in ipaddress.ip_network(text) for text in _PRIVATE)


def for_address(address: str, folder: Path, now: datetime) -> Certificates:
    """Certificates for an address in a private network, made where there are none or they end soon.

    Raises PipelineError for a public address, and where the folder cannot be written to.
    """
    try:
        in_private_network = is_private(address)
    except ValueError:
        raise PipelineError(
            f"--host {address}: is no address, and certificates are made for addresses only; give one, such as"
            " 192.168.1.5, or a certificate of your own by --cert and --key"
        ) from None
    if not in_private_network:
        raise PipelineError(
            f"--host {address}: is a public address, and certificates are made for private networks only; serve on a"
            " private one, or give a certificate of your own by --cert and --key"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        authority = _authority(folder, now)
        leaf, key = folder / _LEAF.format(address=address.replace(":", "_")), folder / _key_of(address)
        if not _is_good(leaf, key, now, authority):
            _sign_leaf(address, folder, leaf, key, now)
    except OSError as error:
        raise PipelineError(
            f"{folder}: certificates cannot be kept there: {error.strerror or error}; make it writable, or give one of"
            " your own by --cert and --key"
        ) from None
    return Certificates(leaf, key, authority)


def given(certificate: Path, key: Path, now: datetime) -> Certificates:
    """A lab's own certificate. Raises PipelineError where it cannot be read, does not fit its key, or has ended."""
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import load_pem_private_key

    try:
        found = x509.load_pem_x509_certificate(certificate.read_bytes())
    except (OSError, ValueError) as error:
        raise PipelineError(f"--cert {certificate}: is no certificate in PEM: {error}") from None
    try:
        private = load_pem_private_key(key.read_bytes(), None)
    except (OSError, ValueError, TypeError) as error:
        raise PipelineError(f"--key {key}: is no private key in PEM without a password: {error}") from None
    if private.public_key() != found.public_key():
        raise PipelineError(f"--key {key}: is not the key of {certificate}; give the one it was made with")
    if found.not_valid_after_utc <= now:
        raise PipelineError(
            f"--cert {certificate}: has ended on {found.not_valid_after_utc:%Y-%m-%d}; renew it, or leave out --cert"
            " and --key, and one is made here"
        )
    return Certificates(certificate, key)


def _key_of(name: str) -> str:
    return _KEY.format(name=name.replace(":", "_"))


def _authority(folder: Path, now: datetime) -> Path:
    """The authority's certificate, made where there is none."""
    path, key = folder / _AUTHORITY, folder / _key_of("authority")
    if not _is_good(path, key, now, path):
        _make_authority(path, key, now)
    return path


def _is_good(certificate: Path, key: Path, now: datetime, signed_by: Path) -> bool:
    from cryptography import x509
    from cryptography.exceptions import InvalidSignature

    try:
        found, authority = (x509.load_pem_x509_certificate(one.read_bytes()) for one in (certificate, signed_by))
        found.verify_directly_issued_by(authority)
        key_there = key.stat().st_size > 0
    except (OSError, ValueError, InvalidSignature):
        return False
    return key_there and found.not_valid_after_utc - now > timedelta(days=_RENEWED_DAYS)


def _make_authority(path: Path, key_path: Path, now: datetime) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.hashes import SHA256

    key = ec.generate_private_key(ec.SECP256R1())
    name = _named(f"Steadyhand on {_this_computer()}")
    uses = x509.KeyUsage(False, False, False, False, False, True, True, False, False)  # signs certificates, no more
    made = (
        x509.CertificateBuilder(name, name, key.public_key(), x509.random_serial_number())
        .not_valid_before(now - _EARLY)
        .not_valid_after(now + timedelta(days=_AUTHORITY_DAYS))
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(uses, critical=True)
        .add_extension(x509.NameConstraints(list(_private_names()), None), critical=True)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
        .sign(key, SHA256())
    )
    _write(path, key_path, [made], key)


def _private_names() -> Iterable[GeneralName]:
    from cryptography import x509

    yield from (x509.IPAddress(ipaddress.ip_network(text)) for text in _PRIVATE)
    yield from (x509.DNSName(name) for name in _PRIVATE_NAMES)


def _sign_leaf(address: str, folder: Path, path: Path, key_path: Path, now: datetime) -> None:
    from cryptography import x509
    from cryptography.hazmat.primitives.asymmetric import ec
    from cryptography.hazmat.primitives.hashes import SHA256
    from cryptography.hazmat.primitives.serialization import load_pem_private_key
    from cryptography.x509.oid import ExtendedKeyUsageOID

    authority = x509.load_pem_x509_certificate((folder / _AUTHORITY).read_bytes())
    signing = load_pem_private_key((folder / _key_of("authority")).read_bytes(), None)
    assert isinstance(signing, ec.EllipticCurvePrivateKey)  # noqa: S101 - of our own making
    key = ec.generate_private_key(ec.SECP256R1())
    names = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(address)), x509.DNSName("localhost")])
    made = (
        x509.CertificateBuilder(authority.subject, _named(address), key.public_key(), x509.random_serial_number())
        .not_valid_before(now - _EARLY)
        .not_valid_after(now + timedelta(days=_LEAF_DAYS) - _EARLY)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(names, critical=False)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signing.public_key()), critical=False)
        .sign(signing, SHA256())
    )
    _write(path, key_path, [made, authority], key)


def _named(name: str) -> Name:
    from cryptography import x509

    return x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, name[:64])])


def _this_computer() -> str:
    import platform

    return platform.node() or "this computer"


def _write(path: Path, key_path: Path, chain: Iterable[Certificate], key: EllipticCurvePrivateKey) -> None:
    """Write a key that nobody else can read, at no moment, and its certificates."""
    from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat

    key_path.unlink(missing_ok=True)
    with os.fdopen(os.open(key_path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()))
    path.write_bytes(b"".join(one.public_bytes(Encoding.PEM) for one in chain))
