"""What the project says of itself, in each place the same."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import yaml

from ema_fmu_src import __author__, __copyright__, __license__, __version__
from ema_fmu_src.fmu import licenses

ROOT = Path(__file__).resolve().parent.parent


def test_the_version_is_that_of_citation_and_changelog() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    version, date = re.findall(r"^## \[(\d+\.\d+\.\d+)\] - (\d{4}-\d\d-\d\d)$", (ROOT / "CHANGELOG.md").read_text(), re.M)[0]
    assert __version__ == version == citation["version"]
    assert date == str(citation["date-released"])


def test_the_citation_names_license_and_paper() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert citation["license"] == __license__ == "MIT" and (ROOT / "LICENSE").read_text().startswith("MIT License")
    (paper,) = citation["references"]
    assert paper["doi"] == "10.1088/1742-6596/2526/1/012076"
    assert [author["family-names"] for author in paper["authors"]] == ["Quattrocchi", "Dalla Vedova", "Berri"]


def test_authors_and_license_are_the_same_everywhere() -> None:
    text = (ROOT / "LICENSE").read_text()
    assert licenses.OWN == text and f"\n{__copyright__}\n" in text
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert [{"name": __author__}] == citation["authors"] == project["authors"]
    assert project["license"] == __license__


def test_the_command_line_tells_the_version() -> None:
    program = "import sys; from harness.cli import main; sys.argv = ['ema', '--version']; main()"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout == f"EMA twins {__version__}\n"
