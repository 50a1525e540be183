"""What of a machine decides results, in words."""

from __future__ import annotations

import platform

import numpy as np
from threadpoolctl import threadpool_info


def cpu_type() -> str:
    """What decides how sums are rounded here: system, processor family, and the instructions NumPy and BLAS use.

    On one type the same command gives the same bytes; on another, runs may part ways.
    """
    libraries = [library for library in threadpool_info() if library["user_api"] == "blas"]
    blas = sorted({f"{library['internal_api']} {library.get('architecture')}" for library in libraries})
    simd = np.show_config(mode="dicts")["SIMD Extensions"].get("found", [])
    return " · ".join([platform.system(), platform.machine(), *blas, *simd])
