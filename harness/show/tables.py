"""The port table, from the ports' one declaration."""

from ema_fmu_src import ports

PORT_HEADINGS = ("vr", "name", "causality", "variability", "type", "unit", "start", "min", "max", "description")


def _text(value: float | None) -> str:
    return "" if value is None else f"{value:g}"


def port_rows() -> list[tuple[str, ...]]:
    """A row of texts for each variable, under PORT_HEADINGS."""
    rows: list[tuple[str, ...]] = []
    for reference, port in enumerate(ports.VARIABLES):
        starts = {model: port.start_for(model) for model in ports.MODELS}
        if port.causality in ("output", "local"):
            start = ""
        elif len(set(starts.values())) > 1:
            start = ", ".join(f"{model} {value:g}" for model, value in starts.items())
        else:
            start = port.text(port.start)
        items = f" ({', '.join(f'{value} {item}' for item, value in port.items.items())})" if port.items else ""
        unused = f" (no effect in {', '.join(port.unused_by)})" if port.unused_by else ""
        limits = ("", "") if port.kind == "Boolean" else (_text(port.minimum), _text(port.maximum))
        rows.append(
            (
                str(reference),
                port.name,
                port.causality,
                port.variability,
                port.kind,
                port.unit,
                start,
                *limits,
                port.description + items + unused,
            )
        )
    return rows


def ports_markdown() -> str:
    """The port table in Markdown."""
    lines = ["| " + " | ".join(PORT_HEADINGS) + " |", "|" + " --- |" * len(PORT_HEADINGS)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in port_rows())])
