"""The paper's five notebooks run on `vsp` alone."""

import pytest
from support import python

from vsp.run.atomic import ROOT

FIVE = sorted(path.stem for path in (ROOT / "notebooks").glob("0[1-5]_*.ipynb"))
RUN = """
import json, sys
names = {"__name__": "__main__"}
for cell in [cell for cell in json.load(open(sys.argv[1]))["cells"] if cell["cell_type"] == "code"]:
    tags = cell["metadata"].get("tags", [])
    if "skip-execution" not in tags:
        exec("".join(cell["source"]), names)
    if "parameters" in tags:
        names |= {"out": sys.argv[2], "runs": sys.argv[2] + "/runs", "quick": True}
print("modules:", *{name.partition(".")[0] for name in sys.modules})
"""


@pytest.mark.parametrize("name", FIVE)
def test_one_loads_no_other_part(name, tmp_path):
    loaded = set(python(RUN, f"notebooks/{name}.ipynb", tmp_path).rpartition("modules:")[2].split())
    assert "vsp" in loaded and not loaded & {"vsp_beyond", "studies", "vsp_course"}
