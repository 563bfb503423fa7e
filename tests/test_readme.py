"""The README says what is so: its port table is the ports', its snippets run."""

import re
import shutil
from pathlib import Path

import pytest

from harness.tables import ports_markdown

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
