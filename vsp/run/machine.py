"""The CPU and BLAS type that determines rounding."""

from __future__ import annotations

import platform

import numpy as np
from threadpoolctl import threadpool_info


def cpu_type() -> str:
    """Return the system, processor family, and instructions of BLAS and NumPy: they determine how sums are rounded.

    On one type the same command gives the same bytes; on another, runs may diverge.
    """
    libraries = [library for library in threadpool_info() if library["user_api"] == "blas"]
    blas = sorted({f"{library['internal_api']} {library.get('architecture')}" for library in libraries})
    simd = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return " · ".join([platform.system(), platform.machine(), *blas, *simd])
