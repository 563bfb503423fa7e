"""The READMEs' examples run, and print what the READMEs say that they print."""

import json
import os
import re
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import spring
from pages import BLOCKS, ROOT, Block, rows

SNIPPETS = [block for block in BLOCKS if block.language == "python"]


def marked(mark: str) -> Block:
    """The one block with this mark."""
    (block,) = (block for block in BLOCKS if block.mark == mark)
    return block


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
    (plan,) = (block.text for block in BLOCKS if block.language == "toml" and block.page.parent.name == "campaigns")
    (folder / "plan.toml").write_text(plan)
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


@pytest.mark.long
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


def test_an_actuator_of_ones_own_is_shown_and_flown(clone: Path) -> None:
    text, *_ = (block.text for block in BLOCKS if block.language == "toml" and block.page.parent.name == "actuators")
    (clone / "mine.toml").write_text(text)
    assert "my EMA" in run(marked("run: an actuator of your own"), clone)
    assert "position [m]" in (clone / "results" / "SIN_HF.csv").read_text().partition("\n")[0]


def test_a_log_is_flown_again(clone: Path) -> None:
    """A healthy twin beside a run with 1.5 times the friction: the keys that the page lists, and a current that differs."""
    block = marked("run: a log flown again")
    assert "position" in run(block, clone) and (clone / "results" / "CHIRP_HF_replayed.html").is_file()
    found = json.loads((clone / "replay.json").read_text())
    assert found["channels"]["equivalent_current_filtered"]["nrmse"] > 0.01 > found["channels"]["position"]["nrmse"] > 0.0
    text = block.page.read_text()
    for key in (*found, *found["tracking_error"]):
        assert key in text


def test_an_actuator_is_calibrated(clone: Path) -> None:
    """The friction that the plant was set to, in the file that is written; and the keys that the page lists."""
    block = marked("run: a calibration")
    assert "TRAPEZOID_HF (not fitted)" in run(block, clone) and (clone / "mine.html").is_file()
    found = json.loads((clone / "mine.json").read_text())
    assert abs(found["parameters"]["mechanics.T_coulomb"]["value"] - 0.034) < 0.0005
    text = block.page.read_text()
    for key in (*found, *found["inflation"], *found["parameters"]["mechanics.C"]):
        assert key in text
    assert '"mechanics.T_coulomb"' in (clone / "mine.toml").read_text()


def test_every_marked_block_is_run() -> None:
    source = Path(__file__).read_text()
    for block in BLOCKS:
        assert not block.mark.startswith("run: ") or f'marked("{block.mark}")' in source, block
