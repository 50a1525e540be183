"""What a wheel holds: `vsp` and `vsp_beyond`, with the shipped teachers and the paper's values as `vsp/data`.

`studies` and `vsp_course` are used in a checkout only. All else about the project is in pyproject.toml.
"""

from setuptools import find_packages, setup

DATA = {"vsp.data.paper": "data/paper", "vsp.data.teachers": "data/teachers"}

setup(
    packages=[*find_packages(include=["vsp", "vsp.*", "vsp_beyond", "vsp_beyond.*"]), *DATA],
    package_dir=DATA,
    package_data={
        "vsp.data.paper": ["*.csv", "MANIFEST.sha256"],
        "vsp.data.teachers": ["*.json", "*.safetensors", "MANIFEST.sha256", "short/*"],
        "vsp.show.explorer": ["*.js", "*.css"],
        "vsp_beyond.proofs": ["*.c"],
    },
)
