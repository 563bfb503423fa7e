"""Cross-check results: where they are stored, and how an FMU carries them.

An importer that repeats them has imported the FMU correctly. They are stored beside the FMUs, in fmus/reference/, with the
names and the format of the FMI cross-check: NAME_in.csv (inputs), NAME_ref.csv (results), NAME_ref.opt (solver options). An
FMU carries the same files as an experiment according to FMI-LS-REF 1.0.0-alpha.1, the layered standard for related files,
in extra/org.fmi-standard.fmi-ls-ref/.
"""

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

from . import description, markup

FOLDER = Path(__file__).resolve().parents[2] / "fmus" / "reference"
EXTRA = "extra/org.fmi-standard.fmi-ls-ref"
LS_REF_VERSION = "1.0.0-alpha.1"
SUFFIXES = ("_in.csv", "_ref.csv", "_ref.opt")


def paths(model: str, folder: Path = FOLDER) -> list[Path]:
    """Paths of the inputs, the results and the options of the twin `model` ("HF", "ELF" or "LF")."""
    return [folder / f"EMA_{model}{suffix}" for suffix in SUFFIXES]


def members(model: str) -> dict[str, bytes]:
    """What the FMU of the twin `model` carries, archive name -> content; empty if there are no results yet."""
    files = paths(model)
    if not all(path.is_file() for path in files):
        return {}
    stimuli, results, options = files
    manifest = Element(
        "fmiReferences",
        {
            "xmlns:fmi-ls": "http://fmi-standard.org/fmi-ls-manifest",
            "fmi-ls:fmi-ls-name": "org.fmi-standard.fmi-ls-ref",
            "fmi-ls:fmi-ls-version": LS_REF_VERSION,
            "fmi-ls:fmi-ls-description": "Layered Standard providing information on related files included in an FMU.",
        },
    )
    for source, kind, role, text in (
        ("experiments.xml", "text/xml", "experiment/smoke-test", "The paper's trial SIN"),
        (stimuli.name, "text/csv", "other", "Inputs of the experiment"),
        (results.name, "text/csv", "result", "Results of the experiment"),
        (options.name, "text/plain", "other", "How the results were made, after the FMI cross-check"),
    ):
        SubElement(manifest, "Related", type=kind, source=source, role=role, description=text)
    experiments = Element("Experiments")
    told = {"name": "SIN", "description": "The paper's trial SIN"}
    experiment = SubElement(experiments, "Experiment", told | description.EXPERIMENT)
    SubElement(experiment, "Stimuli", source=stimuli.name)
    SubElement(experiment, "References", source=results.name)
    texts = {"fmi-ls-manifest.xml": markup.document(manifest), "experiments.xml": markup.document(experiments)}
    return {f"{EXTRA}/{name}": content for name, content in (texts | {p.name: p.read_bytes() for p in files}).items()}
