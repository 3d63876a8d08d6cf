"""Chooses Mitsuba's variant: vectorised if a suitable LLVM is installed, else scalar."""

import os
import re
import sys
from pathlib import Path

import mitsuba as mi

#: Oldest usable LLVM: 15 and 16 abort on kernels of Mitsuba 3.9.
OLDEST = 17


def choose(threads=0):
    """Set the variant with `threads` threads (0: all). Returns its name."""
    patterns = ("libLLVM*.so.[0-9]*", "libLLVM-[0-9]*.so")
    libraries = [path for pattern in patterns for path in Path("/usr/lib").glob(f"*-linux-gnu/{pattern}")]
    known = {path: [int(n) for n in re.findall("[0-9]+", path.name)] for path in libraries}
    fit = {path: version for path, version in known.items() if version[0] >= OLDEST}
    if fit and "DRJIT_LIBLLVM_PATH" not in os.environ:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(max(fit, key=fit.get))
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        try:
            mi.set_variant("llvm_ad_rgb")
            import drjit as dr

            dr.eval(dr.arange(mi.Float, 2) + 1)
        except Exception as error:  # Dr.Jit raises various errors without LLVM
            print(f"mitsuba: no LLVM ({error}); the scalar variant", file=sys.stderr)
            mi.set_variant("scalar_rgb")
    else:
        print(f"mitsuba: no LLVM of {OLDEST} or later; the scalar variant", file=sys.stderr)
        mi.set_variant("scalar_rgb")
    if threads:
        import drjit as dr

        dr.set_thread_count(threads)
    return mi.variant()
