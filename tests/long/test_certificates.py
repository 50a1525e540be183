"""The committed certificates that take seconds to check; the others are checked by `make test`."""

import pytest

from vsp.run.atomic import ROOT
from vsp_beyond.proofs import check, load_certificate, proved, steps_to_goal

LARGE = [f"simplegoal_{name}" for name in ("best_run", "faithful", "limit", "margin", "paper")]


@pytest.mark.parametrize("name", [*LARGE, "pendulum_faithful"])
def test_committed_certificates_prove_their_claims(name):
    claim = check.check(ROOT / f"data/beyond/proofs/{name}.json")
    assert claim.get("goal", claim.get("proved")) not in ("0", 0)


def test_smaller_boxes_prove_the_program_of_the_policy_at_the_limit():
    assert proved(steps_to_goal(load_certificate("simplegoal_limit")[0], n=2000))
