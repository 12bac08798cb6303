"""The addresses of the page and their handlers. They read stores, add remarks, and start and stop runs.

Handlers work in the thread of the server, which is enough for one person: what has not changed is not read again.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from http import HTTPStatus
from pathlib import Path
from types import MappingProxyType
from urllib.parse import parse_qsl, quote, unquote, urlencode

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.gzip import GZipMiddleware
from starlette.requests import Request
from starlette.responses import (
    FileResponse,
    HTMLResponse,
    PlainTextResponse,
    RedirectResponse,
    Response,
    StreamingResponse,
)
from starlette.routing import Route

from ..errors import EurekaError
from ..report import html
from ..report.view import RunView
from ..store import artifacts, is_run, say
from ..store import look as glance
from ..store.directory import ask_to_stop
from ..types import Glance
from . import actions, folder, guard, pages
from .actions import Launcher
from .follow import Fingerprint, Fresh, Parts, Version, events
from .play import Players

ENTRANCE = "/open"
"""The address that is printed, with the token."""
VIEWS = 8
"""Most runs held in memory, each with its curves and texts; and most runs that are compared."""
PAGES = 32
"""Most pages held in memory as they were shown last."""
ENTRIES = 5000
"""Most lines of the list held in memory."""
_PACKED = (Middleware(GZipMiddleware, compresslevel=5),)
"""Compression of text. Films are compressed already, and server-sent events are sent as they come."""


def build(root: Path, token: str, hosts: Sequence[str], ending: Callable[[], bool] = lambda: False) -> Starlette:
    """The page of the runs below a folder, or of one run.

    Args:
        token: everybody who asks must know it.
        hosts: the names by which the page may be called.
        ending: whether the server is about to end; streams to open pages then end, because it waits for them.
    """
    return Starlette(
        routes=Pages(root, ending).routes(),
        middleware=guard.middleware(token, hosts),
        exception_handlers={404: _lost},
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """A page, and how to render it."""

    template: str
    address: str
    fingerprint: Fingerprint
    """Differs when what `render` shows does."""
    render: Callable[[], Parts]
    values: Mapping[str, object] = field(default_factory=dict[str, object])
    """Values for the template around the parts."""
    moment: Fingerprint = ()
    """Differs when what `live` shows does."""
    live: Callable[[], Parts] = dict
    """Parts that change while a run trains; they replace those of the same names in `render`."""


class Pages:
    """The pages of all runs below a folder."""

    def __init__(self, root: Path, ending: Callable[[], bool]) -> None:
        self._root = root
        self._ending = ending
        self._launcher = Launcher(root)
        self._players = Players()
        self._views: Fresh[RunView] = Fresh(VIEWS)
        self._entries: Fresh[folder.Entry] = Fresh(ENTRIES)
        self._parts: Fresh[Parts] = Fresh(PAGES)
        self._versions: Fresh[Version] = Fresh(PAGES)

    def routes(self) -> list[Route]:
        return [
            Route("/", self.runs, middleware=_PACKED),
            Route(ENTRANCE, _entrance),
            Route("/compare", self.compare, middleware=_PACKED),
            Route("/start", self.start, methods=["POST"]),
            Route("/runs/{name}/", self.overview, middleware=_PACKED),
            Route("/runs/{name}/candidates", self.candidates, middleware=_PACKED),
            Route("/runs/{name}/remarks", self.say, methods=["POST"]),
            Route("/runs/{name}/stop", self.stop, methods=["POST"]),
            Route("/runs/{name}/resume", self.resume, methods=["POST"]),
            Route("/runs/{name}/play/{place}", self.play, methods=["GET", "POST"]),
            Route("/runs/{name}/{path:path}", self.film),
            Route("/style.css", _constant("text/css", html.STYLE), middleware=_PACKED),
            Route("/page.js", _constant("text/javascript", html.PAGE_SCRIPT), middleware=_PACKED),
        ]

    async def runs(self, request: Request) -> Response:
        if is_run(self._root):
            return RedirectResponse(_address(*folder.runs(self._root)), 303)
        return self._answer(request, self._list)

    async def start(self, request: Request) -> Response:
        form = await _form(request)
        try:
            name = self._launcher.start(form)
        except EurekaError as error:
            return self._answer(request, self._list, str(error), form)
        return RedirectResponse(_address(name), 303)

    async def overview(self, request: Request) -> Response:
        return self._answer(request, partial(self._overview, request))

    async def candidates(self, request: Request) -> Response:
        names = request.query_params.getlist("show")
        rest = "candidates?" + urlencode([("show", name) for name in names])
        shown = partial(
            self._about, request, "candidates.html", partial(pages.side_by_side, names), pages.trained, rest
        )
        return self._answer(request, shown)

    async def compare(self, request: Request) -> Response:
        names = [unquote(name) for name in request.query_params.getlist("run")]
        return self._answer(request, partial(self._compared, names))

    async def say(self, request: Request) -> Response:
        form = await _form(request)
        return self._act(request, lambda directory: say(directory, *actions.read(form)), form)

    async def stop(self, request: Request) -> Response:
        return self._act(request, ask_to_stop)

    async def resume(self, request: Request) -> Response:
        return self._act(request, self._launcher.resume)

    def _act(
        self, request: Request, act: Callable[[Path], None], form: Mapping[str, str] = MappingProxyType({})
    ) -> Response:
        """Do something about a run, then show the run again, or the candidates that the form was shown with."""
        name, directory = self._named(request)
        try:
            act(directory)
        except EurekaError as error:
            return self._answer(request, partial(self._overview, request), str(error), form)
        back = form.get("back", "")
        return RedirectResponse(_address(name) + (back if back.startswith("candidates?") else ""), 303)

    async def film(self, request: Request) -> Response:
        """A video of a run; no other file, and only under the very path that the run's view has for it."""
        name, directory = self._named(request)
        path = request.path_params["path"]
        try:
            shown = self._view(name, directory, folder.fingerprint(directory)).videos.values()
        except EurekaError:
            shown = ()  # the run's own page says why
        if path not in shown or not artifacts.exists(directory, path):  # it may have become a link since it was read
            raise HTTPException(404)
        return FileResponse(directory / path, media_type="video/mp4")

    async def play(self, request: Request) -> Response:
        """A candidate's policy at work, as a stream; a form that is posted changes its world."""
        name, directory = self._named(request)
        place = request.path_params["place"]
        key = f"{name}/{place}"
        if request.method == "POST":
            try:
                heard = self._players.tell(key, await _form(request))
            except EurekaError as error:
                return PlainTextResponse(str(error), 400)
            return Response(status_code=204 if heard else 409)
        if not guard.by_our_page(request):  # a link would start a process, and end one that somebody watches
            raise HTTPException(403, guard.OURS_ALONE)
        try:
            view = self._view(name, directory, folder.fingerprint(directory))
            policy = pages.playable(directory, view, place)
        except EurekaError:
            raise HTTPException(404, "The run cannot be read.") from None
        if policy is None:
            raise HTTPException(404, "There is no such policy.")

        playing = self._players.events(key, view.config.env, policy, partial(self._gone, request))
        return StreamingResponse(playing, media_type="text/event-stream")

    def _list(self) -> Page:
        found = {name: (directory, folder.glanced(directory)) for name, directory in folder.runs(self._root).items()}

        def entry(name: str) -> folder.Entry:
            directory, fingerprint = found[name]
            return self._entries.get(name, fingerprint, lambda _: folder.listed(name, directory))

        return Page(
            template="runs.html",
            address="/",
            fingerprint=tuple((name, fingerprint) for name, (_, fingerprint) in found.items()),
            render=lambda: pages.listing([entry(name) for name in found]),
            values=pages.start_form(),
        )

    def _compared(self, names: Sequence[str]) -> Page:
        """Some runs of the folder, compared; unknown ones are left out, and those after the first `VIEWS`."""
        found = folder.runs(self._root)
        known = [name for name in dict.fromkeys(names) if name in found]
        chosen = {name: found[name] for name in known[:VIEWS]}
        fingerprints = {name: folder.fingerprint(directory) for name, directory in chosen.items()}

        def parts() -> Parts:
            views: dict[str, RunView] = {}
            glances: dict[str, Glance] = {}
            for name, directory in chosen.items():
                with suppress(EurekaError):  # the list says why
                    _, glances[name] = glance(directory)
                    views[name] = self._view(name, directory, fingerprints[name])
            return pages.compared(views, glances, len(known) - len(chosen), len(chosen) - len(views))

        address = "/compare?" + urlencode([("run", quote(name)) for name in known])
        fingerprint = tuple(fingerprints.items())
        return Page(template="compare.html", address=address, fingerprint=fingerprint, render=parts)

    def _overview(self, request: Request) -> Page:
        return self._about(request, "run.html", pages.overview, partial(pages.now, name=request.path_params["name"]))

    def _about(
        self,
        request: Request,
        template: str,
        render: Callable[[Path, RunView], Parts],
        live: Callable[[Path, RunView], Parts],
        rest: str = "",
    ) -> Page:
        """A page of one run; `rest` is what follows the run's own address."""
        name, directory = self._named(request)
        fingerprint = folder.fingerprint(directory)

        def parts() -> Parts:
            try:
                return render(directory, self._view(name, directory, fingerprint))
            except EurekaError as error:
                return pages.unreadable(directory, "" if rest else name, str(error))

        def moving() -> Parts:
            try:
                return live(directory, self._view(name, directory, fingerprint))
            except EurekaError:
                return pages.from_afar(directory)

        return Page(
            template=template,
            address=f"{_address(name)}{rest}",
            fingerprint=fingerprint,
            render=parts,
            values={"title": name},
            moment=folder.moment(directory),
            live=moving,
        )

    def _named(self, request: Request) -> tuple[str, Path]:
        """A run of the folder; names are looked up and never made into paths."""
        name = request.path_params["name"]
        directory = folder.runs(self._root).get(name)
        if directory is None:
            raise HTTPException(404, "There is no such run.")
        return name, directory

    def _view(self, name: str, directory: Path, fingerprint: Fingerprint) -> RunView:
        return self._views.get(name, fingerprint, lambda _: RunView.read(directory))

    def _version(self, page: Page) -> Version:
        def parts() -> Parts:
            still = self._parts.get(page.address, page.fingerprint, lambda _: page.render())
            moving = page.live()
            return {**still, **{name: html for name, html in moving.items() if name in still}}

        shown = page.fingerprint, page.moment
        return self._versions.get(page.address, shown, lambda before: Version.make(parts, before))

    def _followed(self, look: Callable[[], Page]) -> Version:
        """The page as it is now, also where its run has been deleted since the page was opened."""
        try:
            return self._version(look())
        except HTTPException:
            return Version.make(pages.vanished)

    async def _gone(self, request: Request) -> bool:
        """Whether nobody listens to the answer any more, or nobody shall."""
        return self._ending() or await request.is_disconnected()

    def _answer(
        self,
        request: Request,
        look: Callable[[], Page],
        problem: str = "",
        filled: Mapping[str, str] = MappingProxyType({}),
    ) -> Response:
        """The page; for a page that is open already, a stream of the changes to its parts.

        Args:
            problem: what was wrong with a person's request, if anything.
            filled: what the person had written into the form, so that nothing has to be typed again.
        """
        if "text/event-stream" in request.headers.get("accept", ""):
            shown = request.query_params.get("shown", "").split(",")
            following = events(partial(self._followed, look), shown, partial(self._gone, request))
            return StreamingResponse(following, media_type="text/event-stream")
        page = look()
        text = pages.layout(
            page.template, self._version(page), address=page.address, problem=problem, filled=filled, **page.values
        )
        return HTMLResponse(text, 400 if problem else 200)


def _address(name: str) -> str:
    return f"/runs/{quote(name)}/"


async def _entrance(request: Request) -> Response:
    """Redirect to the address without the token, so that no bookmark or screenshot holds it. A relative redirect would
    keep it."""
    return RedirectResponse(f"{request.url.scheme}://{request.headers['host']}/", 303)


async def _lost(_: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    said = error.detail if error.detail != HTTPStatus.NOT_FOUND.phrase else "There is no page at this address."
    return HTMLResponse(pages.lost(said), error.status_code)


async def _form(request: Request) -> dict[str, str]:
    """The fields of a form that was sent."""
    return dict(parse_qsl((await request.body()).decode(errors="replace")))


def _constant(media_type: str, names: tuple[str, ...]) -> Callable[[Request], Response]:
    """A handler that answers with files of the folder `templates`, joined. Their address holds their hash, so that a
    browser may cache them."""
    text = str(html.together(names))

    def serve(_: Request) -> Response:
        return Response(text, media_type=media_type, headers={"Cache-Control": "private, max-age=31536000"})

    return serve
