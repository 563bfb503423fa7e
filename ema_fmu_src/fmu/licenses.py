"""documentation/licenses/ of an FMU: our license, and those of what is linked into its binaries (FMI 2.0, section 2.3)."""

from collections.abc import Sequence
from importlib.metadata import distribution
from pathlib import Path

from .. import __copyright__, __license__

FOLDER = "documentation/licenses"
OWN = f"""{__license__} License

{__copyright__}

Permission is hereby granted, free of charge, to any person obtaining a copy
of this software and associated documentation files (the "Software"), to deal
in the Software without restriction, including without limitation the rights
to use, copy, modify, merge, publish, distribute, sublicense, and/or sell
copies of the Software, and to permit persons to whom the Software is
furnished to do so, subject to the following conditions:

The above copyright notice and this permission notice shall be included in all
copies or substantial portions of the Software.

THE SOFTWARE IS PROVIDED "AS IS", WITHOUT WARRANTY OF ANY KIND, EXPRESS OR
IMPLIED, INCLUDING BUT NOT LIMITED TO THE WARRANTIES OF MERCHANTABILITY,
FITNESS FOR A PARTICULAR PURPOSE AND NONINFRINGEMENT. IN NO EVENT SHALL THE
AUTHORS OR COPYRIGHT HOLDERS BE LIABLE FOR ANY CLAIM, DAMAGES OR OTHER
LIABILITY, WHETHER IN AN ACTION OF CONTRACT, TORT OR OTHERWISE, ARISING FROM,
OUT OF OR IN CONNECTION WITH THE SOFTWARE OR THE USE OR OTHER DEALINGS IN THE
SOFTWARE.
"""
"""The text of the project's file LICENSE, which a wheel keeps elsewhere than a checkout does."""


def _members(others: dict[str, str]) -> dict[str, bytes]:
    """The folder, archive name -> content; license.txt is where a reader begins."""
    named = f"\nThe binaries hold parts of other software, see: {', '.join(sorted(others))}\n" if others else ""
    return {f"{FOLDER}/{name}": text.encode() for name, text in (others | {"license.txt": OWN + named}).items()}


def native(platforms: Sequence[str]) -> dict[str, bytes]:
    """Of a native FMU for `platforms` (names in targets.PLATFORMS). Only Windows' binaries hold more than our own code: what
    starts a library, and helpers of the compiler."""
    if "win64" not in platforms:
        return _members({})
    import ziglang  # the extra [build]

    zig = Path(ziglang.__file__).parent
    sources = {"mingw-w64.txt": zig / "lib" / "libc" / "mingw" / "COPYING", "zig.txt": zig / "LICENSE"}
    return _members({name: source.read_text(encoding="utf-8") for name, source in sources.items()})


def python() -> dict[str, bytes]:
    """Of an FMU with the python runtime, whose binaries are pythonfmu's."""
    text = next(file.read_text() for file in distribution("pythonfmu").files or () if file.name == "LICENSE")
    return _members({"pythonfmu.txt": text})
