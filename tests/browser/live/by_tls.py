"""A phone in a network: pages by TLS with the authority that `record --lan` makes, in a browser that pins its key."""

from __future__ import annotations

import base64
import hashlib
import re
import tempfile
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat

from tests.browser.chromium import tab
from tests.browser.live.acts import fake_sensors, text, touch, wait_for
from tests.browser.live.by_sensors import STUDY, free_udp_port
from tests.browser.live.server import until
from tests.browser.live.whole_study import Operator, opened_as, recorder

_LAN = "127.0.0.2"


def _pin(certificate: Path) -> str:
    """The SHA-256 of a certificate's key, as Chromium takes it."""
    key = x509.load_pem_x509_certificate(certificate.read_bytes()).public_key()
    spki = key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
    return base64.b64encode(hashlib.sha256(spki).digest()).decode()


def joins_by_tls() -> None:
    """The page is secure, its socket connects, and the way to trust shows the fingerprint that was printed."""
    with tempfile.TemporaryDirectory() as made:
        study, config = Path(made) / "study", Path(made) / "config"
        study.mkdir()
        (study / "study.yaml").write_text(STUDY.replace("PORT", str(free_udp_port())), encoding="utf-8")
        with recorder(study, "--lan", "--host", _LAN, XDG_CONFIG_HOME=str(config)) as words:
            pin = _pin(config / "steadyhand" / "authority" / f"{_LAN}.crt")
            printed = re.search(r"SHA-256: ([0-9A-F:]{95})", words.string)
            assert printed is not None
            with tab(f"--ignore-certificate-errors-spki-list={pin}") as opened:
                operator = Operator(opened, words[1])
                assert operator.links()["phone"].startswith(f"https://{_LAN}:")
                phone = opened_as(operator, "phone", 854, 480, before=fake_sensors)
                assert phone.evaluate("isSecureContext && location.protocol === 'https:'")
                wait_for(phone, "#start")
                touch(phone, "#start")
                until(lambda: "No phone" not in text(opened, "#light-list"), "the phone is connected")
                phone.open(f"{phone.evaluate('location.origin')}/ca")
                until(lambda: text(phone, "#fingerprint") == printed[1], "the fingerprint is the printed one")
