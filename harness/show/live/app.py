"""The app: what is asked for by each address, and what is answered."""

from http import HTTPStatus
from importlib.resources import files
from typing import Any

from flask import Flask, Response, request
from plotly.io.json import to_json_plotly
from plotly.offline import get_plotlyjs
from werkzeug.exceptions import HTTPException

from ema_fmu_src.fidelities import FIDELITIES
from harness.errors import HarnessError
from harness.fidelity import file_stem
from harness.files import results
from harness.show.live import form
from harness.show.live.fleet import Fleet
from harness.show.live.guard import Hosts, Turns, protect
from harness.show.live.kept import read_actuator, upload
from harness.show.live.refused import Refused
from harness.show.live.view import view
from harness.show.live.wish import Flight, Hangar, Wish, wish_of
from harness.show.page import STYLE

SENT = "application/octet-stream"
"""What an upload calls itself: no form of another site can, without asking first (Fetch, CORS-safelisted headers)."""


def app(fleet: Fleet, hangar: Hangar, hosts: Hosts) -> Flask:
    """The app on the FMUs of `fleet`, which answers those who call it by one of `hosts`."""
    made = Flask(__name__, static_folder=None)
    protect(made, hosts)
    turns = Turns()
    plotly = get_plotlyjs()
    own = {name: files("harness.show.live").joinpath(name).read_text(encoding="utf-8") for name in ("live.js", "live.css")}

    def client() -> str:
        return request.remote_addr or ""

    def asked() -> tuple[Wish, Flight]:
        wish = wish_of(request.args)
        return wish, hangar.flight(wish)

    @made.get("/")
    def index() -> Any:
        try:
            wish = wish_of(request.args)
            actuator = hangar.checked(wish)
        except HarnessError as error:
            return form.page(hangar, Wish(), hangar.own, str(error)), _status(error)
        return form.page(hangar, wish, actuator)

    @made.get("/fly")
    def fly() -> Response:
        with turns.turn(client()):
            wish, flight = asked()
            runs = fleet.fly(flight)
            return Response(to_json_plotly(view(wish, flight, runs)), mimetype="application/json")

    @made.get("/csv")
    def csv() -> Response:
        with turns.turn(client()):
            _, flight = asked()
            (run,) = fleet.fly(flight.alone).values()
            name = f"{flight.trial.name}_{file_stem(flight.reference)}.csv"
            return _attached(Response(results.trajectory_csv(run), mimetype="text/csv"), name)

    @made.get("/fmu")
    def fmu() -> Response:
        _, flight = asked()
        name = FIDELITIES[flight.reference].fmu
        try:
            data = (fleet.fmus / name).read_bytes()
        except OSError as error:
            raise Refused(f"{name}: cannot be read: {error.strerror}", HTTPStatus.GONE) from None
        return _attached(Response(data, mimetype=SENT), name)

    @made.post("/file")
    def file() -> dict[str, str]:
        if request.mimetype != SENT:
            line = f"Content-Type: {request.mimetype[:50] or 'none'}; {SENT} is needed"
            raise Refused(line, HTTPStatus.UNSUPPORTED_MEDIA_TYPE)
        for key in request.args:
            if key not in ("kind", "name", "actuator") or len(request.args.getlist(key)) > 1:
                raise Refused("an upload says kind, name and actuator, once each")
        new = upload(request.args.get("kind", ""), request.args.get("name", ""), request.get_data(cache=False))
        with turns.turn(client()):
            if new.kind == "actuator":
                read_actuator(new)
            else:
                hangar.kept.read_trial(new, hangar.actuator(request.args.get("actuator", "")))
        return {"token": hangar.kept.keep(new), "name": new.name}

    @made.get("/plotly.js")
    def script() -> Response:
        answer = Response(plotly, mimetype="text/javascript")
        answer.headers["Cache-Control"] = "private, max-age=3600"
        return answer

    @made.get("/live.js")
    def own_script() -> Response:
        return Response(own["live.js"], mimetype="text/javascript")

    @made.get("/live.css")
    def style() -> Response:
        return Response(STYLE + own["live.css"], mimetype="text/css")

    @made.errorhandler(HarnessError)
    def refuse(error: HarnessError) -> tuple[dict[str, str], int]:
        return {"error": str(error)}, _status(error)

    @made.errorhandler(HTTPException)
    def other(error: HTTPException) -> tuple[dict[str, str], int]:
        return {"error": f"{error.name}: {request.method} {request.path[:100]}"}, error.code or 500

    return made


def _status(error: HarnessError) -> int:
    return int(error.status if isinstance(error, Refused) else HTTPStatus.BAD_REQUEST)


def _attached(answer: Response, name: str) -> Response:
    plain = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "._-") else "_" for letter in name)
    answer.headers["Content-Disposition"] = f'attachment; filename="{plain}"'
    return answer
