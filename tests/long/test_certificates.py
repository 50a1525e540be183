"""The committed certificates that take seconds to check; the others are checked by `make test`."""

import pytest

from vsp.run.atomic import ROOT
from vsp_beyond.proofs import check


@pytest.mark.parametrize("name", ["best_run", "limit", "margin", "paper"])
def test_committed_certificates_prove_their_claims(name):
    assert check.check(ROOT / f"data/beyond/proofs/simplegoal_{name}.json")["goal"] != "0"
