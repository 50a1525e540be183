"""The committed certificates that take seconds to check, others: `make test`. Coq refuses altered data."""

import shutil

import numpy as np
import pytest

from vsp.run.atomic import ROOT
from vsp_beyond.proofs import check, load_certificate, proved, steps_to_goal, theorem

LARGE = [f"simplegoal_{name}" for name in ("best_run", "faithful", "limit", "margin", "paper")]


@pytest.mark.parametrize("name", [*LARGE, "pendulum_faithful"])
def test_committed_certificates_prove_their_claims(name):
    claim = check.check(ROOT / f"data/beyond/proofs/{name}.json")
    assert claim.get("goal", claim.get("proved")) not in ("0", 0)


def test_smaller_boxes_prove_the_program_of_the_policy_at_the_limit():
    assert proved(steps_to_goal(load_certificate("simplegoal_limit")[0], n=2000))


@pytest.mark.skipif(shutil.which("coqc") is None, reason="no Coq")
def test_coq_refuses_one_altered_rank_box_or_coefficient(tmp_path):
    policy = load_certificate(theorem.POLICY)[0]
    found, signs = theorem.steps(policy), policy.coefficients.copy()
    right, place = theorem.files(policy, found), np.arange(found.size).reshape(found.shape)
    signs[1, 0, 0] *= -1
    ranks = [found - (place == 90), np.maximum(found, theorem.UNPROVED * (place == 147 * theorem.N + 150))]
    texts = [theorem.files(policy, wrong)["Ranks"] for wrong in ranks]
    texts += [right["Ranks"].replace('"A', '"', 1), right["Ranks"]]  # one is missing; none
    altered = [*(("Ranks", one) for one in texts), ("Policy", theorem.files(policy.with_maps(signs), found)["Policy"])]
    for name, text in right.items():
        (tmp_path / f"{name}.v").write_text(text)
    theorem.compiled(tmp_path, theorem.ORDER[:-1])
    for name, text in altered:
        (tmp_path / f"{name}.v").write_text(text)
        theorem.compiled(tmp_path, [name])
        if text != right[name]:
            with pytest.raises(ValueError, match=r"Theorem\.v(.|\n)*check \(rank_in ranks\) the_policy = true"):
                theorem.compiled(tmp_path, ["Theorem"])
