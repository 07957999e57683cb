"""Whether this processor has the instructions that the package was built for.

Loading the extension module on another one would end Python with "illegal instruction", so it is asked before,
in Python.
"""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

from ._errors import ProcessorError

#: Instructions of x86-64-v3 by their names in /proc/cpuinfo.
NEEDED = ("avx2", "fma", "bmi1", "bmi2", "f16c", "movbe", "abm")

#: Number of AVX2 for Windows' IsProcessorFeaturePresent.
_WINDOWS_AVX2 = 40


def missing(cpuinfo: str) -> list[str]:
    """Instructions that a processor lacks, by the text of /proc/cpuinfo; none where it does not say."""
    for line in cpuinfo.splitlines():
        key, _, value = line.partition(":")
        if key.strip() == "flags":
            flags = value.split()
            return [name for name in NEEDED if name not in flags]
    return []


def _lacking() -> list[str]:
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return []
    if sys.platform == "linux":
        try:
            return missing(Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace"))
        except OSError:
            return []
    if sys.platform == "win32":
        import ctypes

        present = ctypes.windll.kernel32.IsProcessorFeaturePresent(_WINDOWS_AVX2)
        return [] if present else ["avx2"]
    return []


def check() -> None:
    """Raise `ProcessorError` on a processor without AVX2, unless TESSUTO_ANY_PROCESSOR is set."""
    lacking = [] if os.environ.get("TESSUTO_ANY_PROCESSOR") else _lacking()
    if lacking:
        raise ProcessorError(
            "this processor",
            f"tessuto is built for processors with AVX2 (most since 2013); this one lacks {', '.join(lacking)}",
            "take another machine; or build on this one without .cargo/config.toml and set TESSUTO_ANY_PROCESSOR=1",
        )
