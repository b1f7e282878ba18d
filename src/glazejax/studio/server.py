"""The studio's door: a page and a socket, for this computer alone.

It listens on 127.0.0.1. The link carries a token, without which nothing is answered; Host and
Origin of every request must be this server's own; the page may load nothing from elsewhere
(Content-Security-Policy). Nothing is kept: a dropped file lies in a temporary folder as it is read.
"""

import asyncio
import mimetypes
import secrets
import socket
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from ..extras import require
from ..paint.media import Pigment
from .jobs import Jobs
from .messages import MOST_BYTES
from .page_data import page_data
from .session import Session

HOST = "127.0.0.1"


class Studio:
    """The application and what its pages share.

    Args:
        port: to listen on; 0 for a free one.
        tasks: searches, see `glazejax.studio.jobs`; those installed if left out.
        own_paints: paints in addition to the catalogues', by names that no catalogue has.

    Raises:
        ModuleNotFoundError: a package of the extra `studio` is not installed.
        OSError: the port is taken.
    """

    def __init__(
        self,
        port: int = 0,
        tasks: dict[str, str] | None = None,
        own_paints: Mapping[str, Pigment] | None = None,
    ):
        require("starlette", "uvicorn", "websockets")
        self.token: str = secrets.token_urlsafe(24)
        self._socket = socket.socket()
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self._socket.bind((HOST, port))
        # From here on a browser waits for its answer instead of being refused.
        self._socket.listen(128)
        self.port: int = self._socket.getsockname()[1]
        self.jobs: Jobs = Jobs(tasks)
        self._hosts = {f"{HOST}:{self.port}", f"localhost:{self.port}"}
        self._server: Any = None
        self._data = page_data(own_paints)

    @property
    def link(self) -> str:
        """The page's address, token included."""
        return f"http://{HOST}:{self.port}/{self.token}/"

    def run(self) -> None:
        """Serve until `stop`, or Ctrl-C."""
        import uvicorn

        settings = uvicorn.Config(
            self.app(),
            log_level="error",
            ws="websockets-sansio",
            ws_max_size=MOST_BYTES,
            lifespan="off",
            server_header=False,
            ws_ping_interval=20,
            ws_ping_timeout=60,
        )
        self._server = uvicorn.Server(settings)
        try:
            self._server.run(sockets=[self._socket])
        finally:
            self.jobs.close()

    def stop(self) -> None:
        """End `run`, from another thread."""
        if self._server is not None:
            self._server.should_exit = self._server.force_exit = True

    def refusal(self, headers: Any, token: str, *, socket: bool) -> str:
        """Why a request is refused, in words; empty if it is not."""
        # A socket must come from this page; a plain request may state no origin.
        origin = headers.get("origin")
        if (socket or origin is not None) and origin not in {
            f"http://{host}" for host in self._hosts
        }:
            return "This studio answers its own page only."
        # In constant time, which gives no part of the token away.
        if not secrets.compare_digest(token.encode(), self.token.encode()):
            return (
                "The link's token is not this studio's; open the link that glazejax studio "
                "printed last."
            )
        return ""

    def app(self) -> Any:
        """The ASGI application."""
        from starlette.applications import Starlette
        from starlette.middleware import Middleware
        from starlette.middleware.base import BaseHTTPMiddleware, RequestResponseEndpoint
        from starlette.middleware.trustedhost import TrustedHostMiddleware
        from starlette.requests import Request
        from starlette.responses import PlainTextResponse, Response
        from starlette.routing import Mount, WebSocketRoute
        from starlette.staticfiles import StaticFiles
        from starlette.websockets import WebSocket

        # So that one page's large file keeps no other waiting.
        pool = ThreadPoolExecutor(6)
        policy = (
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
            f"connect-src 'self' {' '.join(f'ws://{host}' for host in sorted(self._hosts))}; "
            "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
        )
        guards = {
            "Content-Security-Policy": policy,
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
            "Cache-Control": "no-store",
        }

        async def guard(request: Request, answer: RequestResponseEndpoint) -> Response:
            """A file of the page, to who has the token."""
            token = request.url.path.split("/")[1]
            if refusal := self.refusal(request.headers, token, socket=False):
                response = PlainTextResponse(refusal + "\n", 403)
            else:
                response = await answer(request)
            response.headers.update(guards)
            return response

        async def talk(socket: WebSocket) -> None:
            """A page's socket."""
            if self.refusal(socket.headers, socket.path_params["token"], socket=True):
                await socket.close(4403)
                return
            await socket.accept()
            loop = asyncio.get_running_loop()
            answers = asyncio.Queue()

            def send(message: bytes) -> None:
                # Searches answer from threads of their own; the queue belongs to the loop.
                loop.call_soon_threadsafe(answers.put_nowait, message)

            async def sender() -> None:
                while True:
                    await socket.send_bytes(await answers.get())

            session = Session(self.jobs, send, self._data)
            sending = asyncio.create_task(sender())
            waiting: set[asyncio.Future[None]] = set()
            try:
                while True:
                    message = await socket.receive()
                    if message["type"] == "websocket.disconnect":
                        break
                    content = message.get("bytes") or message.get("text") or ""
                    # Who asks faster than answers come is refused, so that memory stays bounded.
                    if len(waiting) > 50:
                        words = "too many messages wait for an answer"
                        session.tell({"type": "error", "about": "", "words": words})
                        continue
                    # Reading a file takes long, and the socket must stay open meanwhile.
                    task = loop.run_in_executor(pool, session.handle, content)
                    waiting.add(task)
                    task.add_done_callback(waiting.discard)
            finally:
                session.close()
                sending.cancel()

        # Windows may have another name for it, which browsers refuse.
        mimetypes.add_type("text/javascript", ".js")
        return Starlette(
            routes=[
                WebSocketRoute("/{token}/socket", talk),
                Mount("/{token}", StaticFiles(packages=[("glazejax.studio", "page")], html=True)),
            ],
            middleware=[
                Middleware(TrustedHostMiddleware, allowed_hosts=[HOST, "localhost"]),
                Middleware(BaseHTTPMiddleware, dispatch=guard),
            ],
        )
