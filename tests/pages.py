"""The Markdown pages of the project, taken apart: blocks, code in the text, links, tables."""

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("ema_fmu_src", "fmus", "harness", "tests")
PAGES = sorted([*ROOT.glob("*.md"), *(page for name in PACKAGES for page in (ROOT / name).rglob("*.md"))])
BLOCK = re.compile(r"(?:^<!-- ([^\n]+) -->\n)?^```(\w*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`([^`\n]+)`")
MATHS = re.compile(r"\$`[^`]+`\$")
LINK = re.compile(r"\]\(([^)\s]+)\)")


@dataclass(frozen=True)
class Block:
    """A fenced block, and the comment that stands before it."""

    page: Path
    mark: str
    language: str
    text: str


BLOCKS = [Block(page, *(part or "" for part in found)) for page in PAGES for found in BLOCK.findall(page.read_text())]


def prose(page: Path) -> str:
    """The page without its blocks."""
    return BLOCK.sub("", page.read_text())


def spans(page: Path) -> list[str]:
    """What stands as code in the text; mathematics is none."""
    return SPAN.findall(MATHS.sub("", prose(page)))


def links(page: Path) -> list[str]:
    """Where the page's links and pictures point to."""
    return LINK.findall(prose(page))


def anchors(page: Path) -> set[str]:
    """The names by which GitHub lets the page's headings be linked to."""
    headings = re.findall(r"^#+ (.+)$", prose(page), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def rows(text: str, separator: str) -> list[list[str]]:
    """The cells of the lines that hold a row of a table."""
    lines = [line.strip() for line in text.splitlines() if line.strip().startswith(separator)]
    return [[cell.strip() for cell in line.strip(separator).split(separator)] for line in lines]
