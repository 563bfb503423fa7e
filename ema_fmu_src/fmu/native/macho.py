"""Shared libraries for macOS: their link, and several processors in one file."""

import struct
from collections.abc import Mapping
from pathlib import Path

from .targets import Target

FAT_MAGIC, FAT_ALIGN = 0xCAFEBABE, 14
CPU = {"x86_64": (0x01000007, 3), "arm64": (0x0100000C, 0)}
"""Mach-O's cputype and cpusubtype of each processor."""
NOTHING_ENTITLED = """<?xml version="1.0" encoding="UTF-8"?>
<!DOCTYPE plist PUBLIC "-//Apple//DTD PLIST 1.0//EN" "http://www.apple.com/DTDs/PropertyList-1.0.dtd">
<plist version="1.0"><dict/></plist>
"""


def link(target: Target, name: str, folder: Path) -> list[str]:
    """Words of zig that link the library `name` in `folder`; the object files are to follow.

    The install name holds no path of the build. The library is signed ad hoc: zig does so for Apple's own processors, and
    for the others where there are entitlements to sign, though they be none.
    """
    words = ["build-lib", "-dynamic", "-target", target.zig, "-fstrip", "-lc", "-install_name", f"@rpath/{name}"]
    if target.triple.startswith("x86_64"):
        entitlements = folder / "entitlements.plist"
        entitlements.write_text(NOTHING_ENTITLED)
        words += ["--entitlements", str(entitlements)]
    return [*words, f"-femit-bin={folder / name}"]


def universal(slices: Mapping[str, bytes]) -> bytes:
    """A universal binary (mach-o/fat.h) of one binary for each processor, processor -> content."""
    head = struct.pack(">II", FAT_MAGIC, len(slices))
    body = b""
    offset = 1 << FAT_ALIGN
    for name, content in slices.items():
        padded = content + bytes(-len(content) % (1 << FAT_ALIGN))
        head += struct.pack(">5I", *CPU[name], offset, len(content), FAT_ALIGN)
        body += padded
        offset += len(padded)
    return head.ljust(1 << FAT_ALIGN, b"\0") + body
