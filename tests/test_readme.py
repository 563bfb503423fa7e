"""The README says what is so: its port table is the ports', its snippets run."""

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from harness.cli import app
from harness.show.tables import ports_markdown

README = Path(__file__).resolve().parent.parent / "README.md"
SNIPPETS = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)


def test_port_table_is_that_of_the_ports():
    assert ports_markdown() in (README.parent / "fmus" / "ports.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("snippet", SNIPPETS, ids=["fmpy", "harness"])
def test_python_snippets_run_and_print_a_number(snippet, fmus, tmp_path, monkeypatch, capsys):
    (tmp_path / "fmus").mkdir()
    for path in fmus.values():
        shutil.copy(path, tmp_path / "fmus")
    monkeypatch.chdir(tmp_path)
    exec(compile(snippet, str(README), "exec"), {})
    assert 0.0 < float(capsys.readouterr().out)


def test_guide_from_fault_data_to_an_identified_fault(fmus, tmp_path, monkeypatch):
    """The guide's two commands after the installation; what the page prints under them is inside the intervals found."""
    text = README.read_text(encoding="utf-8")
    block = re.search(r"<!-- guide -->\n```sh\n(.*?)```", text, re.DOTALL)
    assert block
    install, fly, identify = block[1].splitlines()
    assert install.startswith(".venv/bin/pip install") and fly.startswith(".venv/bin/ema run")
    monkeypatch.chdir(tmp_path)
    for line in (fly, f"{identify} --json found.json"):
        words = shlex.split(line)[1:]
        result = CliRunner().invoke(app, [*words, "--fmus", str(fmus["HF"].parent)])
        assert result.exit_code == 0, result.output
    found = json.loads((tmp_path / "found.json").read_text())["faults"]
    rows = re.findall(r"^\| (\w+) \| ([\d.]+)(?: rad)? \| [-\d.]+ to [-\d.]+", text, re.MULTILINE)
    assert [name for name, _ in rows] == list(found)
    for name, estimate in rows:
        assert found[name]["low"] <= float(estimate) <= found[name]["high"]
        assert found[name]["alarm"] == (name in ("friction", "N_a"))
