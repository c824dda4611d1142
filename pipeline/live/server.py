"""The pages and their sockets: what is asked for is looked at here, who asks in `access`."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Awaitable, Callable
from functools import cache
from pathlib import Path

import orjson
import yaml
from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.base import BaseHTTPMiddleware
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket

from pipeline.live.access import Access
from pipeline.live.adapters import websocket
from pipeline.live.certificates import Certificates
from pipeline.live.events import Role
from pipeline.live.loop import Loop

PAGES = Path(__file__).parent / "pages"
_TYPES = {".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml"}
_BODY_BYTES = 512
HEADERS = {
    "Content-Security-Policy": "default-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'none'",
    "Permissions-Policy": "accelerometer=(self), gyroscope=(self), magnetometer=(self), screen-wake-lock=(self),"
    " camera=(), microphone=(), geolocation=()",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


def app(loop: Loop, access: Access, certificates: Certificates | None = None) -> Starlette:
    """The application of a run. `certificates` are those that it is served with."""

    refused: Counter[str] = Counter()
    loop.refused.append(refused)

    async def guarded(request: Request, answer: Callable[[Request], Awaitable[Response]]) -> Response:
        if not access.is_our_host(request.headers.get("host", "")):
            response: Response = PlainTextResponse("This address is not ours.", 421)
        else:
            response = await answer(request)
        for name, value in HEADERS.items():
            response.headers[name] = value
        return response

    def page(name: str) -> Route:
        return Route(f"/{name}", lambda _: _file(PAGES / f"{name}.html", "text/html"))

    def socket(role: Role) -> WebSocketRoute:
        async def serve(asked: WebSocket) -> None:
            headers, client = asked.headers, asked.client.host if asked.client else ""
            ours = access.is_our_origin(headers.get("origin", ""), headers.get("host", ""))
            if ours and access.is_let_in(role, asked.cookies, client):
                await websocket.serve(asked, role, loop, refused)
            else:
                await asked.accept()  # a page cannot see the code of a connection that was never there
                await asked.close(websocket.FORBIDDEN)

        return WebSocketRoute(f"/socket/{role}", serve)

    async def join(request: Request) -> Response:
        return await _join(request, access)

    async def code(request: Request) -> Response:
        has_authority = certificates is not None and certificates.authority is not None
        return _code(request, access, has_authority)

    async def authority(_: Request) -> Response:
        """The certificate that phones have to trust; no secret."""
        if certificates is None or certificates.authority is None:
            return _nothing()
        headers = {"Content-Disposition": 'attachment; filename="steadyhand.crt"'}
        return Response(certificates.authority.read_bytes(), media_type="application/x-x509-ca-cert", headers=headers)

    async def fingerprint(_: Request) -> Response:
        return JSONResponse({"fingerprint": None if certificates is None else certificates.fingerprint() or None})

    routes = [
        *(page(name) for name in ("operator", "phone", "questionnaire")),
        Route("/join", join, methods=["POST"]),
        Route("/join", lambda _: _file(PAGES / "join.html", "text/html"), methods=["GET"]),
        Route("/ca", lambda _: _file(PAGES / "ca.html", "text/html")),
        Route("/ca.crt", authority),
        Route("/ca.json", fingerprint),
        Route("/pages/texts/{language}.json", _texts),
        Route("/pages/{name}", _asset),
        Route("/qr/{role}.svg", code),
        *(socket(role) for role in ("operator", "phone", "questionnaire")),
    ]
    return Starlette(routes=routes, middleware=[Middleware(BaseHTTPMiddleware, dispatch=guarded)])


def _file(path: Path, media_type: str) -> Response:
    """A small file of ours, read at once: Starlette's own way opens it in a thread, and a connection that ends then
    leaves it open."""
    return Response(path.read_bytes(), media_type=media_type) if path.is_file() else _nothing()


def _nothing() -> Response:
    return PlainTextResponse("There is no such page.", 404)


async def _asset(request: Request) -> Response:
    """A script, style or picture that lies beside the pages."""
    known = {path.name: path for path in PAGES.iterdir() if path.suffix in _TYPES}
    path = known.get(request.path_params["name"])
    return _nothing() if path is None else _file(path, _TYPES[path.suffix])


async def _texts(request: Request) -> Response:
    texts = _languages().get(request.path_params["language"])
    return _nothing() if texts is None else Response(texts, media_type="application/json")


@cache
def _languages() -> dict[str, bytes]:
    """Each language's texts as JSON."""
    found = {}
    for path in (PAGES / "texts").glob("*.yaml"):
        found[path.stem] = json.dumps(yaml.safe_load(path.read_text(encoding="utf-8"))).encode()
    return found


async def _join(request: Request, access: Access) -> Response:
    """Exchange a key for its role's cookie."""
    if not access.is_our_origin(request.headers.get("origin", ""), request.headers.get("host", "")):
        return JSONResponse({"why": "This page is not ours."}, 403)
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > _BODY_BYTES:
            return JSONResponse({"why": "That is no key."}, 413)
    try:
        key = orjson.loads(body)["k"]
    except (ValueError, KeyError, TypeError):
        key = None
    role = access.role_of_key(key, request.client.host if request.client else "") if isinstance(key, str) else None
    if role is None:
        return JSONResponse({"why": "This key is not valid any more."}, 403)
    response = JSONResponse({"role": role, "go": f"/{role}"})
    secure = request.url.scheme == "https"
    response.set_cookie(access.cookie(role), access.tokens[role], httponly=True, samesite="strict", secure=secure)
    return response


def _code(request: Request, access: Access, has_authority: bool) -> Response:
    """The code that leads a phone or a questionnaire's tablet here, or to how it comes to trust this computer."""
    client, role = request.client.host if request.client else "", request.path_params["role"]
    known = ("phone", "questionnaire", *(("ca",) if has_authority else ()))
    if role not in known or not access.is_let_in("operator", request.cookies, client):
        return PlainTextResponse("Only the operator's page may see this.", 403)
    import io

    import segno

    picture = io.BytesIO()
    address = f"{access.origin}/ca" if role == "ca" else access.address(role)
    segno.make(address).save(picture, kind="svg", scale=6, border=3, light="#fff", xmldecl=False)
    return Response(picture.getvalue(), media_type="image/svg+xml")
