"""Who is let in from a network: certificates over real TLS, tokens of each role, Host and Origin, where from."""

from __future__ import annotations

import io
import json
import ssl
import stat
import sys
from collections.abc import Callable
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
import segno
import websockets
from cryptography import x509

from pipeline.errors import PipelineError
from pipeline.live import certificates, record
from pipeline.live.access import ROLES, Access
from pipeline.live.certificates import Certificates, for_address, given
from pipeline.live.record import Serving, secured
from tests.pipeline.live.running import Running, free_port, served

NOW = datetime.now(UTC)
_LAN = "127.0.0.2"  # of this computer, and yet not where an operator's page is let in
_PHONE = "127.0.0.3"
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs addresses 127.0.0.2 and 127.0.0.3")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return for_address(_LAN, tmp_path_factory.mktemp("config") / "authority", NOW)


def trusting(authority: Path) -> ssl.SSLContext:
    return ssl.create_default_context(cafile=str(authority))


async def asks(
    running: Running, context: ssl.SSLContext, method: str, path: str, body: bytes = b"", **headers: str
) -> tuple[int, str, bytes]:
    """A request by TLS from a phone's address: status, head, body."""
    import asyncio

    where = {"host": _LAN, "port": running.access.port, "local_addr": (_PHONE, 0)}
    reader, writer = await asyncio.open_connection(**where, ssl=context, server_hostname=_LAN)  # type: ignore[arg-type]
    sent = {"Host": f"{_LAN}:{running.access.port}", "Content-Length": str(len(body)), "Connection": "close", **headers}
    lines = [f"{method} {path} HTTP/1.1", *(f"{name}: {value}" for name, value in sent.items()), "", ""]
    writer.write("\r\n".join(lines).encode() + body)
    head, _, content = (await reader.read()).partition(b"\r\n\r\n")
    writer.close()
    return int(head.split()[1]), head.decode().lower(), content


def page(running: Running, context: ssl.SSLContext, role: str, **changes: Any) -> Any:
    given = {"origin": running.access.origin, "additional_headers": running.headers(role), **changes}
    where = f"wss://{_LAN}:{running.access.port}/socket/{role}"
    return websockets.connect(where, ssl=context, local_addr=(_PHONE, 0), **given)


def in_network(
    folder: Path, made: Certificates, play: Callable[[Running], Any], operator_anywhere: bool = False
) -> None:
    served(folder, play, access=Access("https", _LAN, free_port(), operator_anywhere), certificates=made)


def drawn_code(address: str) -> bytes:
    """The QR code of an address, as the operator's page shows it."""
    picture = io.BytesIO()
    segno.make(address).save(picture, kind="svg", scale=6, border=3, light="#fff", xmldecl=False)
    return picture.getvalue()


def test_a_phone_that_trusts_the_authority_joins_and_another_does_not(tmp_path: Path, made: Certificates) -> None:
    assert made.authority is not None
    other = for_address(_LAN, tmp_path / "other", NOW).authority
    assert other is not None and made.authority is not None
    context = trusting(made.authority)

    async def play(running: Running) -> None:
        origin = running.access.origin
        key = json.dumps({"k": running.access.keys["phone"]}).encode()
        status, head, _ = await asks(running, context, "POST", "/join", key, Origin=origin)
        assert status == 200
        assert "; secure" in head and "httponly" in head and "samesite=strict" in head
        async with page(running, context, "phone") as phone:
            assert json.loads(await phone.recv())["type"] == "welcome"
        with pytest.raises(ssl.SSLCertVerificationError):
            await asks(running, trusting(other), "GET", "/phone")
        with pytest.raises(ssl.SSLCertVerificationError):
            page_of_other = page(running, trusting(other), "phone")
            await page_of_other
        # The certificate that is to be trusted can be had before it is, and nothing else of its folder.
        unknowing = ssl.create_default_context()
        unknowing.check_hostname, unknowing.verify_mode = False, ssl.CERT_NONE
        status, _, body = await asks(running, unknowing, "GET", "/ca.crt")
        assert (status, body) == (200, made.authority.read_bytes())  # type: ignore[union-attr]
        status, _, body = await asks(running, unknowing, "GET", "/ca.json")
        assert json.loads(body) == {"fingerprint": made.fingerprint()}
        assert (await asks(running, unknowing, "GET", "/ca"))[0] == 200
        assert (await asks(running, unknowing, "GET", "/authority.key"))[0] == 404
        status, _, code = await running.asks("GET", "/qr/ca.svg", **running.headers("operator"))
        assert status == 200
        assert code == drawn_code(f"{origin}/ca")
        assert (await asks(running, unknowing, "GET", "/qr/ca.svg"))[0] == 403
        assert (await running.asks("GET", "/phone"))[0] == 200  # by plain HTTP on this computer, as at a USB cable

    in_network(tmp_path / "study", made, play)


def test_without_tls_a_phone_joins_as_a_display_and_the_operator_stays_here(tmp_path: Path) -> None:
    access, certificates = secured(Serving(host=_LAN, port=free_port(), lan=True, plain=True), tmp_path, NOW)
    assert (access.origin, certificates) == (f"http://{_LAN}:{access.port}", None)

    async def play(running: Running) -> None:
        where = f"ws://{_LAN}:{access.port}/socket"
        ours: dict[str, Any] = {"origin": access.origin, "local_addr": (_PHONE, 0)}
        async with websockets.connect(f"{where}/phone", additional_headers=running.headers("phone"), **ours) as phone:
            assert json.loads(await phone.recv())["type"] == "welcome"
        async with websockets.connect(
            f"{where}/operator", additional_headers=running.headers("operator"), **ours
        ) as page:
            with pytest.raises(websockets.ConnectionClosed):
                await page.recv()
        assert (await running.asks("GET", "/ca.crt"))[0] == 404

    served(tmp_path / "study", play, access=access)


@pytest.mark.parametrize("role", ROLES)
def test_a_role_is_had_by_its_own_token_and_from_where_it_may_be(tmp_path: Path, made: Certificates, role: str) -> None:
    assert made.authority is not None
    context = trusting(made.authority)

    async def play(running: Running) -> None:
        access, port = running.access, running.access.port
        other = next(one for one in ROLES if one != role)
        refused: tuple[dict[str, Any], ...] = (
            {"additional_headers": {}},
            {"additional_headers": {"Cookie": f"{access.cookie(role)}=guessed"}},  # type: ignore[arg-type]
            {"additional_headers": {"Cookie": f"{access.cookie(role)}={access.tokens[other]}"}},  # type: ignore[arg-type]
            {"additional_headers": running.headers(other)},
            {"origin": None},
            {"origin": f"http://{_LAN}:{port}"},
            {"origin": f"https://evil.example:{port}"},
            {"origin": f"http://127.0.0.1:{port}"},
        )
        for changes in refused:
            async with page(running, context, role, **changes) as one:
                with pytest.raises(websockets.ConnectionClosed) as closed:
                    await one.recv()
                assert closed.value.rcvd is not None and closed.value.rcvd.code == 4403
        wrong = json.dumps({"k": access.tokens[role]}).encode()  # type: ignore[index]
        assert (await asks(running, context, "POST", "/join", wrong, Origin=access.origin))[0] == 403
        right = json.dumps({"k": access.keys[role]}).encode()  # type: ignore[index]
        assert (await asks(running, context, "POST", "/join", right))[0] == 403  # no Origin
        assert (await asks(running, context, "GET", "/phone", Host=f"evil.example:{port}"))[0] == 421
        status, _, _ = await asks(running, context, "POST", "/join", right, Origin=access.origin)
        assert status == (403 if role == "operator" else 200)  # an operator sits at this computer
        if role == "operator":
            async with page(running, context, role) as one:
                with pytest.raises(websockets.ConnectionClosed):
                    await one.recv()
            own = {"Origin": f"http://127.0.0.1:{port}"}
            assert (await running.asks("POST", "/join", right, **own))[0] == 200
            assert access.address("operator").startswith(f"http://127.0.0.1:{port}/operator#k=")

    in_network(tmp_path, made, play)


def test_with_operator_lan_the_operator_may_be_elsewhere(tmp_path: Path, made: Certificates) -> None:
    assert made.authority is not None
    context = trusting(made.authority)

    async def play(running: Running) -> None:
        async with page(running, context, "operator") as one:
            assert json.loads(await one.recv())["type"] == "state"
        assert running.access.address("operator").startswith(f"https://{_LAN}:")

    in_network(tmp_path, made, play, operator_anywhere=True)


def test_keys_are_nobody_else_s_and_certificates_stay_until_they_end_soon(tmp_path: Path) -> None:
    folder = tmp_path / "authority"
    first = for_address(_LAN, folder, NOW)
    for key in folder.glob("*.key"):
        assert stat.S_IMODE(key.stat().st_mode) == 0o600
    assert len(list(folder.glob("*.key"))) == 2
    assert stat.S_IMODE(folder.stat().st_mode) == 0o700
    before, trusted = first.certificate.read_bytes(), first.fingerprint()
    assert for_address(_LAN, folder, NOW + timedelta(days=300)).certificate.read_bytes() == before
    assert for_address("192.168.7.7", folder, NOW).fingerprint() == trusted  # trusted once, for all
    assert for_address(_LAN, folder, NOW + timedelta(days=370)).certificate.read_bytes() != before
    late = NOW + timedelta(days=3640)
    assert for_address(_LAN, folder, late).fingerprint() != trusted
    other = for_address("192.168.7.7", folder, late)  # signed anew too, by the new authority
    assert other.authority is not None
    leaf, authority = (x509.load_pem_x509_certificate(one.read_bytes()) for one in (other.certificate, other.authority))
    leaf.verify_directly_issued_by(authority)


@pytest.mark.parametrize("address", ["8.8.8.8", "2001:4860:4860::8888"])
def test_the_authority_can_sign_for_no_public_address(
    tmp_path: Path, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(PipelineError, match="is a public address"):
        for_address(address, tmp_path, NOW)
    monkeypatch.setattr(certificates, "is_private", lambda _: True)  # as a thief of the key would
    stolen = for_address(address, tmp_path, NOW)
    assert stolen.authority is not None
    with pytest.raises(ssl.SSLCertVerificationError, match="permitted subtree violation"):
        _shake_hands(stolen, trusting(stolen.authority), address)
    good = for_address("192.168.7.7", tmp_path, NOW)
    _shake_hands(good, trusting(stolen.authority), "192.168.7.7")


def _shake_hands(of: Certificates, client: ssl.SSLContext, address: str) -> None:
    """A TLS handshake in memory."""
    server = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    server.load_cert_chain(of.certificate, of.key)
    to_server, to_client = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [
        client.wrap_bio(to_client, to_server, server_hostname=address),
        server.wrap_bio(to_server, to_client, server_side=True),
    ]
    for _ in range(6):
        for end in ends:
            with suppress(ssl.SSLWantReadError):
                end.do_handshake()
    assert ends[0].version() == "TLSv1.3"


def test_what_stands_in_the_way_of_a_network_is_said_with_its_remedy(
    tmp_path: Path, made: Certificates, monkeypatch: pytest.MonkeyPatch
) -> None:
    def said(now: datetime = NOW, **options: Any) -> str:
        with pytest.raises(PipelineError) as raised:
            secured(Serving(**options), tmp_path / "authority", now)
        return str(raised.value)

    assert "unless --lan is given" in said(host="192.168.7.7")
    assert "name one address" in said(host="0.0.0.0", lan=True)  # noqa: S104
    assert "name one address" in said(host="127.0.0.1", lan=True)
    assert "certificates are made for addresses only" in said(host="lab.example", lan=True)
    assert "give both" in said(lan=True, certificate=made.certificate)
    assert "add --lan" in said(operator_lan=True)
    assert "add --lan" in said(plain=True)
    assert "leave out --cert, --key and --operator-lan" in said(host=_LAN, lan=True, plain=True, operator_lan=True)
    own: dict[str, Any] = {"host": _LAN, "lan": True, "certificate": made.certificate}
    assert "has ended on" in said(NOW + timedelta(days=400), **own, key=made.key)
    assert "is not the key of" in said(**own, key=made.key.with_name("authority.key"))
    assert "is no private key" in said(**own, key=made.certificate)
    assert "is no certificate" in said(**{**own, "certificate": made.key}, key=made.key)
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(PipelineError, match="certificates cannot be kept there"):
        secured(Serving(host=_LAN, lan=True), tmp_path / "file" / "authority", NOW)
    monkeypatch.setattr(record, "SOMEWHERE", "127.0.0.1")  # the way there is no network's
    assert "has no address in a network" in said(lan=True)
    assert given(made.certificate, made.key, NOW).fingerprint() == ""


def test_pages_are_served_on_this_computer_alone_unless_a_network_is_asked_for(tmp_path: Path) -> None:
    access, found = secured(Serving(), tmp_path, NOW)
    assert (access.origin, found, list(tmp_path.iterdir())) == ("http://127.0.0.1:8443", None, [])
    access, found = secured(Serving(host="10.1.2.3", lan=True), tmp_path, NOW)
    assert access.origin == "https://10.1.2.3:8443"
    assert found is not None and found.authority == tmp_path / "authority.crt"
