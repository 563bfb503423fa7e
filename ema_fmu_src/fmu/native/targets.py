"""The platforms that a native FMU can carry a binary for."""

import platform
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Target:
    """A processor and an operating system, as the tools call them."""

    triple: str
    """For LLVM, which emits the kernels."""
    zig: str
    """For zig, which compiles the C part and links."""


@dataclass(frozen=True)
class Platform:
    """One binary in an FMU: its folder under binaries/, its suffix, and its targets (two in a universal binary).

    `beside`: folders that hold the binary of one of the targets alone.
    """

    folder: str
    suffix: str
    targets: tuple[Target, ...]
    beside: Mapping[str, Target] = field(default_factory=dict)


LINUX_X86 = Target("x86_64-unknown-linux-gnu", "x86_64-linux-gnu.2.17")
LINUX_ARM = Target("aarch64-unknown-linux-gnu", "aarch64-linux-gnu.2.17")
WINDOWS_X86 = Target("x86_64-w64-windows-gnu", "x86_64-windows-gnu")
MAC_X86 = Target("x86_64-apple-macosx11.0.0", "x86_64-macos.11.0")
MAC_ARM = Target("arm64-apple-macosx11.0.0", "aarch64-macos.11.0")

PLATFORMS = {
    "linux64": Platform("linux64", ".so", (LINUX_X86,)),
    "linux-arm64": Platform("aarch64-linux", ".so", (LINUX_ARM,)),
    "win64": Platform("win64", ".dll", (WINDOWS_X86,)),
    "darwin64": Platform("darwin64", ".dylib", (MAC_X86, MAC_ARM), {"aarch64-darwin": MAC_ARM}),
}
"""By their names for `ema build --platform`. The folders are those of FMI 2.0, except those for arm64, for which only FMI
3.0 has any (section 2.5.1.1); on a Mac, importers look into either."""


def host() -> str:
    """Name in `PLATFORMS` of this machine; ValueError if no FMU can be built for it."""
    arm = platform.machine().lower() in ("arm64", "aarch64")
    name = {"linux": "linux-arm64" if arm else "linux64", "win32": "win64", "darwin": "darwin64"}.get(sys.platform)
    if name is None:
        raise ValueError(f"no native FMU for the platform {sys.platform}: the platforms are {', '.join(PLATFORMS)}")
    return name


def parse(text: str) -> list[str]:
    """Names in `PLATFORMS` from a comma-separated list of them, which may contain `host` and `all`; ValueError otherwise."""
    chosen: dict[str, None] = {}
    for name in (part.strip() for part in text.split(",") if part.strip()):
        if name not in ("host", "all", *PLATFORMS):
            raise ValueError(f"no platform {name}: host, all, {', '.join(PLATFORMS)} are known")
        chosen |= dict.fromkeys(PLATFORMS if name == "all" else [host() if name == "host" else name])
    if not chosen:
        raise ValueError(f"no platform given: host, all, {', '.join(PLATFORMS)} are known")
    return list(chosen)
