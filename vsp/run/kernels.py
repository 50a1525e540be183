"""Fix the kernels of NumPy and OpenBLAS to those of x86-64-v3 (AVX2 with FMA): sums are rounded alike everywhere.

Newer processors have wider instructions, which add in another order. `environment.sh` lets every Python of .venv call
`fix` as it starts, before NumPy is imported: make, workers, kernels of notebooks, JupyterLab, papermill and pytest. So
this file imports nothing of the project. Run as a script, it says when bytes may differ from the committed ones.
"""

import os

FIXED = {"OPENBLAS_CORETYPE": "Haswell", "NPY_ENABLE_CPU_FEATURES": "X86_V3"}
NEEDED = {"avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "abm", "movbe"}  # X86_V3 in the words of Linux


def available() -> bool:
    """Return whether Linux names all instructions of x86-64-v3. NumPy would refuse to start without one of them."""
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            flags = next((line for line in lines if line.startswith("flags")), "")
    except OSError:
        return False
    return NEEDED <= set(flags.split())


def fix() -> None:
    """Fix the kernels of this process and its children by environment variables, unless the processor is too old."""
    if available():
        os.environ.update(FIXED)
        os.environ.pop("NPY_DISABLE_CPU_FEATURES", None)  # NumPy refuses to start with both variables


def fixed() -> bool:
    """Return whether `fix` was called as this process or its parent started, and fixed the kernels."""
    return FIXED.items() <= os.environ.items()


def name() -> str:
    """Return the kernels that run here: one name on every machine where they are fixed."""
    if fixed():
        return "x86-64-v3"
    import platform

    from threadpoolctl import threadpool_info

    blas = {str(library.get("architecture")) for library in threadpool_info() if library["user_api"] == "blas"}
    return " ".join([platform.machine(), *sorted(blas)])


if __name__ == "__main__" and not fixed():
    print("this processor lacks AVX2 or is not an x86-64 under Linux: bytes may differ from the committed ones")
