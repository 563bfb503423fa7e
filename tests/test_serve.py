"""The live page: what it refuses, what it answers, and the page itself in a real browser.

The truths: the command line's own run of the same command, and Chromium's console, which names what the policy blocks.
"""

import base64
import json
import shlex
import shutil
import socket
import sys
import tempfile
import threading
from collections.abc import Iterator
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlencode

import numpy as np
import pytest

from harness.actuators.actuator import DEFAULT
from harness.cli import main
from harness.errors import HarnessError
from harness.faults import ESTIMATED
from harness.files.reader import read_table
from harness.show.live.fleet import Fleet
from harness.show.live.guard import LARGEST_BODY, Hosts, Turns, is_loopback
from harness.show.live.kept import MOST_KEPT, Kept
from harness.show.live.refused import Refused
from harness.show.live.server import MOST_CONNECTIONS, Server
from harness.show.live.wish import Hangar, Wish

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
BINARY = {"Content-Type": "application/octet-stream"}
OWN_TRIAL = b"time,command,load_torque\n0,0,0\n0.1,0.01,0\n0.2,0.01,2\n0.3,0,2\n"
OWN_ACTUATOR = b'name = "stiff"\ndescription = "<b>mine</b>"\n[parameters]\n"mechanics.T_coulomb" = 0.05\n'


@pytest.fixture(scope="module")
def server(fmus: dict[str, Path]) -> Iterator[Server]:
    made = Server(fmus["HF"].parent, host="127.0.0.1", port=0)
    thread = threading.Thread(target=made.run)
    thread.start()
    yield made
    made.stop()
    thread.join(timeout=20)
    assert not thread.is_alive()


def port_of(server: Server) -> int:
    return int(server.url.rstrip("/").rpartition(":")[2])


def ask(
    server: Server, path: str, *, method: str = "GET", body: bytes | None = None, headers: dict[str, str] | None = None
) -> tuple[int, dict[str, str], bytes]:
    connection = HTTPConnection("127.0.0.1", port_of(server), timeout=120)
    try:
        connection.request(method, path, body, headers or {})
        answer = connection.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
    finally:
        connection.close()


def refusal(server: Server, path: str, **options: Any) -> tuple[int, str]:
    """Status, and the one line of the refusal."""
    status, _, body = ask(server, path, **options)
    line = json.loads(body)["error"]
    assert line and "\n" not in line and "Traceback" not in line
    return status, line


def fly(server: Server, **query: Any) -> dict[str, Any]:
    status, _, body = ask(server, f"/fly?{urlencode(query, doseq=True)}")
    assert status == 200, body
    return dict(json.loads(body))


def upload(server: Server, kind: str, name: str, data: bytes) -> tuple[int, dict[str, str]]:
    path = f"/file?{urlencode({'kind': kind, 'name': name})}"
    status, _, body = ask(server, path, method="POST", body=data, headers=BINARY)
    return status, dict(json.loads(body))


def drawn(answer: dict[str, Any], name: str, place: int = 0) -> np.ndarray:
    """The values of the `place`-th curve of that name."""
    curves = [trace for trace in answer["figure"]["data"] if trace["name"] == name]
    packed = curves[place]["y"]
    return np.frombuffer(base64.b64decode(packed["bdata"]), packed["dtype"])


@pytest.mark.parametrize("path", ["/", "/fly", "/csv", "/fmu", "/file", "/plotly.js", "/nothing"])
@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1.evil.example", "", "localhost@evil.example", "10.0.0.1:8050"])
def test_a_host_that_is_not_ours_gets_nothing(server: Server, path: str, host: str) -> None:
    status, _, body = ask(server, path, headers={"Host": host})
    assert status == 400 and len(body) < 300


def test_the_names_of_this_machine_are_ours_on_any_port() -> None:
    local = Hosts("127.0.0.1", ["twin.example"])
    for host in ("127.0.0.1", "localhost:9000", "LOCALHOST.", "[::1]:80", "twin.example"):
        assert local.trusts(host), host
    for host in (
        "192.168.0.4",
        "localhost:x",
        "localhost:999999",
        "[::1],evil.example",
        "localhost,localhost",
        "localhost\n",
        "a localhost",
        "[::1",
        "localhost/",
    ):
        assert not local.trusts(host), host
    everywhere = Hosts("0.0.0.0")
    assert everywhere.trusts("192.168.0.4:8050") and everywhere.trusts(socket.gethostname())
    assert not everywhere.trusts("evil.example")
    assert is_loopback("127.0.0.1") and is_loopback("localhost") and not is_loopback("0.0.0.0")


@pytest.mark.parametrize("path", ["/", "/fly?trial=NONE", "/live.js", "/nothing"])
def test_every_answer_bears_the_policy(server: Server, path: str) -> None:
    _, headers, _ = ask(server, path)
    policy = dict(part.split(" ", 1) for part in headers["content-security-policy"].split("; "))
    assert policy["default-src"] == "'none'" and policy["script-src"] == "'self'"
    assert policy["frame-ancestors"] == policy["base-uri"] == policy["form-action"] == "'none'"
    assert headers["x-content-type-options"] == "nosniff" and "python" not in headers["server"].lower()


@pytest.mark.parametrize(
    "headers", [{"Origin": "http://evil.example"}, {"Origin": "null"}, {"Sec-Fetch-Site": "cross-site"}]
)
def test_another_sites_page_cannot_fly_or_upload(server: Server, headers: dict[str, str]) -> None:
    assert refusal(server, "/fly", headers=headers)[0] == 403
    assert refusal(server, "/file", method="POST", body=b"x", headers=BINARY | headers)[0] == 403
    assert ask(server, "/", headers={"Sec-Fetch-Site": "cross-site"})[0] == 200  # a link from elsewhere may open the page


@pytest.mark.parametrize(
    "query, word",
    [
        ("trial=SIN5", "did you mean SIN?"),
        ("trial=SIN&trial=SIN4", "given 2 times"),
        ("fidelity=ELF%2B,MF", "unknown fidelity"),
        ("fidelity=", "no fidelity"),
        ("actuator=/etc/passwd", "unknown actuator"),
        ("actuator=../library/default.toml", "unknown actuator"),
        ("set=fault.friction", "NAME=VALUE is needed"),
        ("set=fault.friction=[1]", "number"),
        ("set=fault.friction=nan", "out of range"),
        ("set=fault.friction=1e9", "out of range"),
        ("set=fault.frictoin=1", "did you mean fault.friction"),
        ("set=fault.gain=1&set=fault.gain=2", "set 2 times"),
        ("set=fault.zeta=0.6", "less than 1"),
        ("set=controller.current_control=2", "does not go with"),
        ("residuals=yes", "0 or 1"),
        ("trail=SIN", "did you mean trial"),
        ("trial=" + "S" * 300, "300 characters"),
        ("&".join(f"set=x{i}=1" for i in range(100)), "64 are taken"),
        ("trial=%00%ff", "unknown trial"),
    ],
)
def test_a_query_that_means_nothing_is_400_and_one_line(server: Server, query: str, word: str) -> None:
    status, line = refusal(server, f"/fly?{query}")
    assert status == 400 and word in line, line
    status, _, page = ask(server, f"/?{query}")  # the page comes up all the same, and says so
    assert status == 400 and b'role="alert"' in page and b"<select" in page


@pytest.mark.parametrize(
    "path, method, status",
    [
        ("/fly", "POST", 405),
        ("/nothing", "GET", 404),
        ("/../../etc/passwd", "GET", 404),
        ("/fly?trial=" + "S" * 9000, "GET", 414),
    ],
)
def test_what_is_not_there_is_one_line(server: Server, path: str, method: str, status: int) -> None:
    assert refusal(server, path, method=method)[0] == status


@pytest.mark.parametrize(
    "kind, name, data, status, word",
    [
        ("trial", "a.csv", b"", 415, "is no text of columns"),
        ("trial", "a.csv.gz", b"\x1f\x8b\x08\x00", 415, "other formats"),
        ("trial", "a.csv", b"time,command\n0,0\n1,x\n", 400, "a.csv"),
        ("trial", "a.csv", b"time,command\n0,0\n1000,0\n", 400, "to 10 s can be flown"),
        ("trial", "a.csv", b"time,command\n0,0\n1e300,0\n", 400, "a.csv"),
        ("trial", "a.csv", b"time,command" + b",x" * 5000, 400, "at most 1000"),
        ("actuator", "a.toml", b"name = [", 400, "is not TOML"),
        ("actuator", "a.toml", b"a = " + b"[" * 50000, 400, "a.toml"),
        ("actuator", "a.toml", b'[parameters]\n"motor.R" = "fast"\n', 400, "motor.R"),
        ("actuator", "a.toml", b"#" * 200_000, 413, "at most 100000"),
        ("fmu", "a.fmu", b"PK", 400, "trial or actuator"),
        ("trial", "a.csv", b"1\n" * 200_001, 400, "at most 200000"),
        ("trial", "a.csv", b"0" * (LARGEST_BODY + 1), 413, "Too Large"),
    ],
)
def test_an_upload_that_cannot_be_used_is_one_line(
    server: Server, kind: str, name: str, data: bytes, status: int, word: str
) -> None:
    got, answer = upload(server, kind, name, data)
    assert got == status and word in answer["error"], answer
    assert tempfile.gettempdir() not in answer["error"]


def test_an_upload_says_what_it_is(server: Server) -> None:
    path = "/file?kind=trial&name=a.csv"
    assert refusal(server, path, method="POST", body=OWN_TRIAL, headers={"Content-Type": "text/plain"})[0] == 415
    assert refusal(server, f"{path}&more=1", method="POST", body=OWN_TRIAL, headers=BINARY)[0] == 400


def test_only_the_latest_uploads_are_kept(server: Server) -> None:
    _, first = upload(server, "actuator", "first.toml", OWN_ACTUATOR)
    for number in range(MOST_KEPT):
        upload(server, "actuator", "next.toml", OWN_ACTUATOR + b"# %d\n" % number)
    status, line = refusal(server, f"/fly?actuator={quote(first['token'])}")
    assert status == 410 and "choose the file again" in line


def test_one_flight_at_a_time_for_a_client_and_few_clients() -> None:
    turns = Turns(most=2)
    with turns.turn("a"):
        with pytest.raises(Refused) as refused, turns.turn("a"):
            pass
        assert refused.value.status == 429
        with turns.turn("b"), pytest.raises(Refused) as refused, turns.turn("c"):
            pass
        assert refused.value.status == 503
    with turns.turn("a"):
        pass


def test_a_second_flight_of_a_client_is_told_to_wait(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    under_way, landed = threading.Event(), threading.Event()

    def slow(*_: Any) -> Any:
        under_way.set()
        landed.wait(30)
        raise Refused("landed")

    monkeypatch.setattr(Fleet, "fly", slow)
    first = threading.Thread(target=ask, args=(server, "/fly"))
    first.start()
    assert under_way.wait(30)
    try:
        assert refusal(server, "/fly")[0] == refusal(server, "/csv")[0] == 429
        assert ask(server, "/")[0] == 200
    finally:
        landed.set()
        first.join()


def test_a_flight_that_would_never_end_is_ended(fmus: dict[str, Path]) -> None:
    hangar = Hangar(DEFAULT, None, Kept())
    fleet = Fleet(fmus["HF"].parent, time_limit=2.0)
    endless = hangar.flight(Wish("SIN", ("LF",), settings=("solver.step=1e-9",)))
    try:
        with pytest.raises(Refused, match="has not finished within 2 s") as refused:
            fleet.fly(endless)
    finally:
        fleet.close()
    assert refused.value.status == 422


def test_many_silent_connections_do_not_pile_up(server: Server) -> None:
    opened = [socket.create_connection(("127.0.0.1", port_of(server))) for _ in range(MOST_CONNECTIONS + 5)]
    try:
        opened[-1].settimeout(10)
        assert opened[-1].recv(1) == b""  # hung up on
    finally:
        for each in opened:
            each.close()
    assert ask(server, "/live.css")[0] == 200


def test_it_flies_what_the_command_line_flies(
    server: Server, fmus: dict[str, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = ["fault.friction=1.5", "load_torque=3", "motor.R=1200 mOhm"]
    answer = fly(server, trial="SIN", fidelity="ELF+,LF", set=settings, residuals=1)
    status, headers, csv = ask(server, f"/csv?{answer['query']}")
    assert status == 200 and 'filename="SIN_ELFplus.csv"' in headers["content-disposition"]
    words = shlex.split(answer["command"])
    monkeypatch.setattr(sys, "argv", [*words, "--out", str(tmp_path), "--fmus", str(fmus["HF"].parent)])
    with pytest.raises(SystemExit):
        main()
    assert (tmp_path / "SIN_ELFplus.csv").read_bytes() == csv
    told = {column.name: column.values for column in read_table(tmp_path / "SIN_ELFplus.csv").columns}
    assert np.allclose(drawn(answer, "ELF+"), np.asarray(told["position"], dtype=float)[::10], rtol=1e-6, atol=1e-9)
    other = {column.name: column.values for column in read_table(tmp_path / "SIN_LF.csv").columns}
    residual = np.asarray(other["position"], dtype=float) - np.asarray(told["position"], dtype=float)
    assert np.allclose(drawn(answer, "LF", 1), residual[::10], atol=1e-8)
    assert "residual: model minus ELF+" in answer["note"] and "LF" in answer["table"] and "reference" in answer["table"]


def test_with_hf_a_healthy_trial_is_judged_as_in_the_report(server: Server) -> None:
    answer = fly(server, trial="SIN", fidelity="HF,LF")
    assert "errors with a budget are within it" in answer["banner"] and "verdict ok" in answer["banner"]
    assert "verdict none" in fly(server, trial="SIN", fidelity="HF,LF", set="fault.friction=2")["banner"]


def test_what_is_set_and_not_used_is_said(server: Server) -> None:
    banner = fly(server, trial="LOAD-STEP", fidelity="LF", set="load_torque=2")["banner"]
    assert "LOAD-STEP gives its own load_torque: the 2 that is set is not used" in banner


def test_own_trial_and_actuator_are_flown(server: Server) -> None:
    status, trial = upload(server, "trial", '../../my <trial>".csv', OWN_TRIAL)
    assert status == 200 and trial["name"] == "my_trial.csv"
    status, actuator = upload(server, "actuator", "stiff.toml", OWN_ACTUATOR)
    assert status == 200
    query = {"trial": trial["token"], "actuator": actuator["token"], "fidelity": "LF"}
    answer = fly(server, **query)
    assert answer["command"] == "ema run --trial-file my_trial.csv --fidelity LF --reference LF --actuator stiff.toml"
    assert "&lt;b&gt;mine&lt;/b&gt;" in answer["about"]
    assert np.allclose(drawn(answer, "command")[[500, 1500]], [0.01, 0.0])
    status, headers, _ = ask(server, f"/csv?{urlencode(query)}")
    assert status == 200 and headers["content-disposition"] == 'attachment; filename="my_trial_LF.csv"'
    page = ask(server, f"/?{urlencode(query)}")[2].decode()
    assert f'<option value="{trial["token"]}" selected>' in page
    assert f'<option value="{actuator["token"]}" selected>' in page


def test_a_linear_actuator_is_shown_in_its_own_units(server: Server) -> None:
    answer = fly(server, actuator="maxon-linear-a", trial="SIN", fidelity="LF")
    assert "[m]" in answer["figure"]["layout"]["yaxis"]["title"]["text"]


def test_an_fmu_of_another_actuator_is_refused(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    record = {"starts": "x", "actuator": "theirs", "actuator_sha256": "0"}
    monkeypatch.setattr("harness.show.live.fleet.record_of", lambda path: record)
    status, line = refusal(server, "/fly?fidelity=LF")
    assert status == 422 and "was built for another actuator, theirs" in line


def test_an_fmu_that_is_gone_is_one_line(server: Server, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(server.fleet, "fmus", tmp_path)
    status, line = refusal(server, "/fmu?fidelity=LF")
    assert status == 410 and line.startswith("EMA_LF.fmu: cannot be read")


def test_a_link_fills_the_form(server: Server) -> None:
    query = urlencode({"set": ["fault.gain=0.8", "fault.friction=1.234", "supply_voltage=40", "motor.R=2 Ohm"]}, doseq=True)
    page = ask(server, f"/?{query}")[2].decode()
    gain, friction = (page.partition(f'id="fault.{name}"')[2].partition("<output")[0] for name in ("gain", "friction"))
    assert 'value="0.8"' in gain and 'data-moved="1"' in gain and 'data-moved="1"' not in friction
    assert 'id="supply_voltage" value="40"' in page
    assert "fault.friction=1.234\nmotor.R=2 Ohm</textarea>" in page  # no slider stands there: it is not rounded
    assert all(f'id="{each.port}"' in page for each in ESTIMATED.values())


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened.new_context(viewport={"width": 1400, "height": 1200})  # one for all: the script is fetched once
        opened.close()


@pytest.fixture
def page(server: Server, browser: Any) -> Iterator[Any]:
    """The page, drawn; in the end, nothing was complained of, and nobody else was asked."""
    opened = browser.new_page()
    opened.set_default_timeout(120_000)
    complaints: list[str] = []
    opened.on("console", lambda message: complaints.append(message.text) if message.type in ("error", "warning") else None)
    opened.on("pageerror", lambda error: complaints.append(str(error)))
    opened.on("request", lambda asked: complaints.append(asked.url) if foreign(asked.url, server) else None)
    opened.goto(server.url)
    opened.wait_for_selector("#command:has-text('ema run SIN4')")
    yield opened
    opened.close()
    assert complaints == []


def until(page: Any, condition: str) -> None:
    """Wait for what is true in the page; Playwright's own way evaluates texts there, which the policy forbids."""
    for _ in range(600):
        if page.evaluate(condition):
            return
        page.wait_for_timeout(50)
    raise AssertionError(condition)


def foreign(address: str, server: Server) -> bool:
    return address.startswith("http") and not address.startswith(server.url)


@needs_browser
def test_sliders_by_keyboard_reset_and_link(page: Any, server: Server) -> None:
    values = "document.getElementById('figure').calcdata[1][105].y"
    before = page.evaluate(values)
    page.focus("[id='fault.friction']")
    for _ in range(5):
        page.keyboard.press("ArrowRight")
    page.wait_for_selector("#command:has-text('fault.friction=1.5')")
    until(page, f"{values} !== {before!r}")
    assert page.url == f"{server.url}?set=fault.friction%3D1.5" == page.evaluate("document.getElementById('link').href")
    page.reload()
    page.wait_for_selector("#command:has-text('fault.friction=1.5')")
    assert page.input_value("[id='fault.friction']") == "1.5"
    page.focus("#reset")
    page.keyboard.press("Enter")
    page.wait_for_selector("#command:text-is('ema run SIN4 --fidelity ELF+,LF --reference ELF+')")
    assert page.url == server.url and page.evaluate(values) == before


@needs_browser
def test_hf_residuals_and_pictures(page: Any, tmp_path: Path) -> None:
    page.check("[name=fidelity][value=HF]")
    page.check("#residuals")
    page.wait_for_selector("#command:has-text('--reference HF')")
    until(page, "Object.keys(document.getElementById('figure').layout).includes('yaxis6')")
    assert "within it" in page.inner_text("#banner .verdict.ok")
    for form, begin in (("png", b"\x89PNG"), ("svg", b"<svg")):
        with page.expect_download() as found:
            page.click(f"[data-picture={form}]")
        found.value.save_as(tmp_path / found.value.suggested_filename)
        assert (tmp_path / f"SIN4.{form}").read_bytes().startswith(begin)


@needs_browser
def test_files_go_up_and_come_down(page: Any, fmus: dict[str, Path], tmp_path: Path) -> None:
    (tmp_path / "mine.csv").write_bytes(OWN_TRIAL)
    (tmp_path / "stiff.toml").write_bytes(OWN_ACTUATOR)
    page.set_input_files("[data-kind=trial]", tmp_path / "mine.csv")
    page.wait_for_selector("#command:has-text('--trial-file mine.csv')")
    page.set_input_files("[data-kind=actuator]", tmp_path / "stiff.toml")
    page.wait_for_selector("#command:has-text('--actuator stiff.toml')")
    assert page.inner_text("#about").startswith("Actuator stiff: <b>mine</b>")
    page.click("summary:has-text('Other parameters')")
    page.fill("#parameters", "motor.R=2 Ohm")
    page.fill("#load_torque", "1.5")
    page.locator("#load_torque").blur()
    page.wait_for_selector("#command:has-text('load_torque=1.5')")
    assert "motor.R=2 Ohm" in page.inner_text("#command")
    for button, name in (("csv", "mine_ELFplus.csv"), ("fmu", "EMA_ELF.fmu")):
        with page.expect_download() as found:
            page.click(f"#{button}")
        assert found.value.suggested_filename == name
        found.value.save_as(tmp_path / name)
    assert len((tmp_path / "mine_ELFplus.csv").read_text().splitlines()) == 3002
    assert (tmp_path / "EMA_ELF.fmu").read_bytes() == fmus["ELF"].read_bytes()


@needs_browser
def test_it_fits_a_narrow_screen_and_the_dark(page: Any) -> None:
    light, dark = (500, "light", "#1b1f24", "rgb(255, 255, 255)"), (1400, "dark", "#e6e9ec", "rgb(20, 24, 28)")
    for width, scheme, ink, back in (light, dark):
        page.emulate_media(color_scheme=scheme)
        page.set_viewport_size({"width": width, "height": 900})
        until(page, f"document.documentElement.scrollWidth <= {width}")
        until(page, f"document.getElementById('figure').layout.font.color === '{ink}'")
        assert page.evaluate("getComputedStyle(document.body).backgroundColor") == back
    unnamed = "[...document.querySelectorAll('select,input,textarea')].filter(e => !e.labels.length).length"
    assert page.evaluate(unnamed) == 0


def test_a_port_that_is_taken_is_one_line(fmus: dict[str, Path], capsys: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(HarnessError, match="cannot be had"):
            Server(fmus["HF"].parent, host="127.0.0.1", port=port)
        monkeypatch.setattr(sys, "argv", ["ema", "serve", "--port", str(port), "--fmus", str(fmus["HF"].parent)])
        with pytest.raises(SystemExit) as ended:
            main()
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
