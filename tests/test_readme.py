"""The READMEs say what is so: commands and options exist, examples run and print what is said, links and paths lead on."""

import json
import os
import re
import shlex
import shutil
import socket
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import spring
import typer

from harness.cli import app
from harness.show.tables import ports_markdown

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("ema_fmu_src", "fmus", "harness", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(page for name in PACKAGES for page in (ROOT / name).rglob("*.md"))])
READMES = [page for page in PAGES if page.name == "README.md"]
LANGUAGES = {"sh", "python", "toml", "yaml", "math", "text"}
"""Of blocks: all but the last two are run or checked here."""
BLOCK = re.compile(r"(?:^<!-- ([^\n]+) -->\n)?^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"(?<!\$)`([^`\n]+)`(?!\$)")
LINK = re.compile(r"\]\(([^)\s]+)\)")
LONGEST = 130
"""Lines of the README at the root."""

each_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))


@dataclass(frozen=True)
class Block:
    """A fenced block, and the comment that stands before it."""

    page: Path
    mark: str
    language: str
    text: str


BLOCKS = [Block(page, *(part or "" for part in found)) for page in PAGES for found in BLOCK.findall(page.read_text())]
SNIPPETS = [block for block in BLOCKS if block.language == "python"]


def marked(mark: str) -> Block:
    """The one block with this mark."""
    (block,) = (block for block in BLOCKS if block.mark == mark)
    return block


def prose(page: Path) -> str:
    """The page without its blocks."""
    return BLOCK.sub("", page.read_text())


def rows(text: str, separator: str) -> list[list[str]]:
    """The cells of the lines that hold a row of a table."""
    lines = [line.strip() for line in text.splitlines() if line.strip().startswith(separator)]
    return [[cell.strip() for cell in line.strip(separator).split(separator)] for line in lines]


# --- what stands in the pages ---------------------------------------------------------------------------------------------


def test_the_readme_at_the_root_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= LONGEST


def test_port_table_is_that_of_the_ports() -> None:
    assert ports_markdown() in (ROOT / "fmus" / "ports.md").read_text(encoding="utf-8")


def test_every_block_says_what_it_is() -> None:
    assert [block for block in BLOCKS if block.language not in LANGUAGES] == []


@each_page
def test_links_lead_somewhere(page: Path) -> None:
    for link in LINK.findall(prose(page)):
        if "://" in link:
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        assert target.exists(), link
        if anchor:
            headings = re.findall(r"^#+ (.+)$", BLOCK.sub("", target.read_text()), re.MULTILINE)
            assert anchor in {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}, link


@each_page
def test_paths_that_are_named_are_there(page: Path) -> None:
    """Of code; a NAME in capitals stands for any."""
    for span in SPAN.findall(prose(page)):
        if re.fullmatch(r"[\w./-]+(?:\.(?:py|c|h|sh)|/)", span):
            pattern = re.sub(r"\bNAME\b", "*", span.rstrip("/"))
            assert any(any(folder.glob(pattern)) for folder in (page.parent, ROOT)), span


@pytest.mark.parametrize("readme", READMES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_readme_names_what_lies_beside_it(readme: Path) -> None:
    named = set(SPAN.findall(prose(readme))) | {link.removesuffix("README.md") for link in LINK.findall(prose(readme))}
    for path in readme.parent.iterdir():
        if path.suffix in (".py", ".c", ".h", ".sh") and path.name != "__init__.py":
            assert path.name in named
        elif path.is_dir() and any(path.glob("*.py")):
            assert f"{path.name}/" in named


# --- commands -------------------------------------------------------------------------------------------------------------


def invocations(page: Path) -> Iterator[tuple[list[str], bool]]:
    """The words of every `ema` command on the page, and whether they are complete: those in prose may hold placeholders."""
    for block in BLOCKS:
        if block.page == page and block.language in ("sh", "yaml"):
            for line in block.text.splitlines():
                for command in re.findall(r"(?<![\w/])(?:\.venv/bin/)?ema ([^&|;#]+)", line):
                    yield shlex.split(command), True
    for span in SPAN.findall(prose(page)):
        if span.startswith("ema "):
            yield shlex.split(span)[1:], not re.search(r"\b[A-Z]{3,}\b|\.\.\.", span)


def resolved(words: list[str]) -> tuple[Any, list[str], Any]:
    """The command that the words name, what follows its name, and its parent's context."""
    command, context = typer.main.get_command(app), None
    while hasattr(command, "commands"):
        context = command.make_context("ema", list(words), parent=context, resilient_parsing="--help" in words)
        _, command, words = command.resolve_command(context, [*context._protected_args, *context.args])
    return command, words, context


@each_page
def test_commands_and_their_options_exist(page: Path) -> None:
    for words, complete in invocations(page):
        if words[0] in ("--help", "COMMAND"):
            continue
        command, rest, context = resolved(words)
        options = {option for parameter in command.params for option in parameter.opts} | {"--help"}
        assert {word.partition("=")[0] for word in rest if word.startswith("--")} <= options, words
        if complete and any(not word.startswith("-") for word in rest):
            command.make_context(command.name, rest, parent=context)


def test_every_command_is_explained() -> None:
    told = prose(ROOT / "harness" / "README.md")
    for name in typer.main.get_command(app).commands:
        assert f"`ema {name}" in told


# --- examples -------------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clone(fmus: dict[str, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the examples find what an installation has: `ema` with the FMUs of this session; pip does nothing."""
    folder = tmp_path_factory.mktemp("clone")
    tools = folder / ".venv" / "bin"
    tools.mkdir(parents=True)
    (folder / "installed").mkdir()
    ema = f'exec {sys.executable} -c "from harness.cli import main; main()" "$@" --fmus {fmus["HF"].parent}'
    for tool, script in (
        (tools / "ema", ema),
        (tools / "dask", f'exec {sys.executable} -m dask "$@"'),
        (tools / "pip", "true"),
        (folder / "installed" / "python3", "true"),
    ):
        tool.write_text(f"#!/bin/sh\n{script}\n")
        tool.chmod(0o755)
    shutil.copytree(fmus["HF"].parent, folder / "fmus")
    spring.build(folder).replace(folder / "load.fmu")
    (folder / "plan.toml").write_text(next(block.text for block in BLOCKS if block.language == "toml"))
    return folder


def run(block: Block, folder: Path) -> str:
    """What the block prints; the jobs that it leaves behind are ended."""
    script = "\n".join(["trap 'kill $(jobs -p) 2>/dev/null || true' EXIT", block.text])
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PATH": f"{folder / 'installed'}:{os.environ['PATH']}"}
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", script], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize("snippet", SNIPPETS, ids=lambda block: str(block.page.parent.relative_to(ROOT)))
def test_python_snippets_run_and_print_a_number(
    snippet: Block, clone: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(clone)
    exec(compile(snippet.text, str(snippet.page), "exec"), {})
    assert 0.0 < float(capsys.readouterr().out)


def test_toml_is_toml() -> None:
    assert [block for block in BLOCKS if block.language == "toml" and not tomllib.loads(block.text)] == []


def test_the_main_job_prints_the_table_of_results(clone: Path) -> None:
    printed = rows(run(marked("run: the main job"), clone), "│")
    told = rows((ROOT / "README.md").read_text(), "|")
    told = told[[row[0] for row in told].index("trial") + 2 :][: len(printed)]
    assert [row[:-1] for row in told] == [row[:-1] for row in printed]  # all but the wall time
    assert (clone / "results" / "report.html").is_file()


def test_guide_from_fault_data_to_an_identified_fault(clone: Path) -> None:
    """What the page prints under the guide is inside the intervals found; and a run of one's own goes the same way."""
    block = marked("run: the guide")
    text = block.page.read_text()
    assert "faulty: N_a = " in run(block, clone)
    shutil.copy(clone / "measured" / "CHIRP_HF.csv", clone / "mine.csv")
    run(marked("run: a run of your own"), clone)
    diagnosis = json.loads((clone / "diagnosis.json").read_text())
    found = diagnosis["faults"]
    told = [(row[0], float(row[1].split()[0])) for row in rows(text, "|") if row[0] in found]
    assert [name for name, _ in told] == list(found)
    for name, estimate in told:
        assert found[name]["low"] <= estimate <= found[name]["high"]
        assert found[name]["alarm"] == (name in ("friction", "N_a"))
    for key in (*diagnosis, *found["friction"]):
        assert f"`{key}`" in text


def test_many_flights_end_in_the_sentence_that_is_told(clone: Path) -> None:
    block = marked("run: many flights")
    sentence = r"friction reaches its limit of 3 in (\d+) days \(90 %: (\d+) to (\d+)\)"
    (told,) = re.findall(f"> {sentence}", block.page.read_text())
    (found,) = re.findall(f"^{sentence}$", run(block, clone), re.MULTILINE)
    assert [int(days) for days in found] == pytest.approx([int(days) for days in told], rel=0.05)


def test_a_campaign_is_flown_here_and_on_a_cluster(clone: Path) -> None:
    assert "256 cases in" in run(marked("run: a campaign"), clone)
    block = marked("run: a cluster")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    elsewhere = Block(block.page, block.mark, block.language, block.text.replace("8786", port))
    shutil.rmtree(clone / "campaign")
    assert "256 cases in" in run(elsewhere, clone)


def test_a_switch_prints_what_jumps(clone: Path) -> None:
    printed = run(marked("run: a switch"), clone)
    assert "HF to ELF+ at 0.6 s jumps by" in printed and "ELF+ to HF at 1.4 s jumps by" in printed


def test_every_marked_block_is_run() -> None:
    source = Path(__file__).read_text()
    for block in BLOCKS:
        assert not block.mark.startswith("run: ") or f'marked("{block.mark}")' in source, block
