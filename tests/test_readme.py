"""The READMEs say what is so: the commands, options, paths and links in them are there. Their examples: test_examples.py."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
import typer
from pages import BLOCKS, PAGES, ROOT, anchors, links, prose, spans

from harness.cli import app
from harness.show.tables import ports_markdown

READMES = [page for page in PAGES if page.name == "README.md"]
LANGUAGES = {"sh", "python", "toml", "yaml", "math", "text"}
"""Of blocks; what stands in all but the last two is run or checked."""
LONGEST = 130
"""Lines of the README at the root."""


def name_of(page: Path) -> str:
    return str(page.relative_to(ROOT))


each_readme = pytest.mark.parametrize("readme", READMES, ids=name_of)


def test_the_readme_at_the_root_is_short() -> None:
    assert len((ROOT / "README.md").read_text().splitlines()) <= LONGEST


def test_port_table_is_that_of_the_ports() -> None:
    assert ports_markdown() in (ROOT / "fmus" / "ports.md").read_text(encoding="utf-8")


def test_every_block_says_what_it_is() -> None:
    assert [block for block in BLOCKS if block.language not in LANGUAGES] == []


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page: Path) -> None:
    for link in links(page):
        if "://" not in link:
            name, _, anchor = link.partition("#")
            target = page.parent / name if name else page
            assert target.exists(), link
            assert not anchor or anchor in anchors(target), link


@each_readme
def test_paths_that_are_named_are_there(readme: Path) -> None:
    """Of code; a NAME in capitals stands for any."""
    for span in spans(readme):
        if re.fullmatch(r"[\w./-]+(?:\.(?:py|c|h|sh)|/)", span):
            pattern = re.sub(r"\bNAME\b", "*", span.rstrip("/"))
            assert any(any(folder.glob(pattern)) for folder in (readme.parent, ROOT)), span


@each_readme
def test_a_readme_names_what_lies_beside_it(readme: Path) -> None:
    named = {*spans(readme), *(link.removesuffix("README.md") for link in links(readme))}
    for path in readme.parent.iterdir():
        if path.suffix in (".py", ".c", ".h", ".sh") and path.name != "__init__.py":
            assert path.name in named, path.name
        elif path.is_dir() and any(path.glob("*.py")):
            assert any(name.startswith(f"{path.name}/") for name in named), path.name


def invocations(page: Path) -> Iterator[tuple[list[str], bool]]:
    """The words after `ema` of every command on the page, and whether it stands in a block: there, it is complete."""
    for block in BLOCKS:
        if block.page == page and block.language in ("sh", "yaml"):
            for command in re.findall(r"(?<![\w/])(?:\.venv/bin/)?ema ([^&|;#\n]+)", block.text):
                yield shlex.split(command), True
    for span in spans(page):
        if span.startswith("ema ") and not span.startswith(("ema --", "ema COMMAND")):
            yield shlex.split(span)[1:], False


@each_readme
def test_commands_and_their_options_exist(readme: Path) -> None:
    for words, complete in invocations(readme):
        command, rest, context = typer.main.get_command(app), words, None
        while hasattr(command, "commands"):
            context = command.make_context("ema", rest, parent=context)
            _, command, rest = command.resolve_command(context, [*context._protected_args, *context.args])
        options = {option for parameter in command.params for option in (*parameter.opts, *parameter.secondary_opts)}
        assert {word.partition("=")[0] for word in rest if word.startswith("--")} <= options, words
        if complete:
            command.make_context(command.name, rest, parent=context)


def test_every_command_is_explained() -> None:
    told = prose(ROOT / "harness" / "README.md")
    for name in typer.main.get_command(app).commands:
        assert f"`ema {name}" in told
