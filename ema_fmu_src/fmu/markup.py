"""XML as all of our files have it: values as text, documents as bytes."""

from xml.etree.ElementTree import Element, indent, tostring

from .. import ports


def literal(kind: ports.Kind, value: float) -> str:
    """`value` of a variable of the type `kind` as text; a Real has the fewest digits that give the same float64 again."""
    if kind == "Boolean":
        return "true" if value else "false"
    return repr(float(value)) if kind == "Real" else str(int(value))


def document(root: Element) -> bytes:
    """The file around `root`, indented, in UTF-8."""
    indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="utf-8") + b"\n"
