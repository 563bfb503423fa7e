"""The verdicts of `ema check` for a CI server: JUnit XML and Markdown."""

from collections import Counter
from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from harness.budgets import Verdict


def junit(verdicts: Sequence[Verdict]) -> str:
    """JUnit XML: a test case for each verdict, with its share of the run's time [s], its error and its budget."""
    failed = [verdict for verdict in verdicts if not verdict.passed]
    of_run = Counter((verdict.trial, verdict.fidelity) for verdict in verdicts)
    times = [(verdict.wall or 0.0) / of_run[verdict.trial, verdict.fidelity] for verdict in verdicts]
    suite = Element("testsuite", name="ema check", tests=str(len(verdicts)), failures=str(len(failed)))
    suite.set("time", f"{sum(times):.6f}")
    for verdict, time in zip(verdicts, times, strict=True):
        where = f"{verdict.trial}.{verdict.fidelity}"
        case = SubElement(suite, "testcase", classname=where, name=verdict.variable, time=f"{time:.6f}")
        if verdict.found is not None:
            properties = SubElement(case, "properties")
            SubElement(properties, "property", name="nrmse", value=f"{verdict.found:.6g}")
            if verdict.judged:
                SubElement(properties, "property", name="budget", value=f"{verdict.budget:.6g}")
        if not verdict.passed:
            SubElement(case, "failure", message=verdict.line)
    indent(suite)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(suite).decode() + "\n"


def markdown(verdicts: Sequence[Verdict]) -> str:
    """A summary for the page of a job; what is outside comes first."""
    failed = [verdict for verdict in verdicts if not verdict.passed]
    judged = any(verdict.judged for verdict in verdicts)
    head = f"**{len(failed)} of {len(verdicts)} budgets exceeded**" if failed else f"**All {len(verdicts)} budgets kept**"
    if not judged:
        head = f"**{len(failed)} of {len(verdicts)} failed**; no budgets: they are the default actuator's"
    lines = [
        "## Fidelities against the reference",
        "",
        head,
        "",
        "| | trial | fidelity | variable | NRMSE | budget | left the tube |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for verdict in sorted(verdicts, key=lambda verdict: verdict.passed):
        found = verdict.failure or ("-" if verdict.found is None else f"{100.0 * verdict.found:.4f} %")
        left = "" if verdict.left is None else f"{verdict.left:.4f} s"
        mark = "ok" if verdict.passed else "**outside**"
        cells = (
            mark,
            verdict.trial,
            verdict.fidelity,
            verdict.variable,
            found,
            f"{100.0 * verdict.budget:.4f} %" if verdict.judged else "-",
            left,
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"
