(** The theorem. Coq evaluates the check of all boxes, and verifies the proof. *)

From VSP Require Import Statement Check Sound Policy Ranks.

Theorem simplegoal_always_arrives : always_arrives the_policy.
Proof. apply (sound _ (rank_in ranks)). vm_cast_no_check (eq_refl true). Qed.

(** Whatever happened before, a step is possible. So there are runs from every start. *)
Theorem never_stuck s : exists t, step the_policy s t.
Proof. now apply a_step_exists. Qed.

Print Assumptions simplegoal_always_arrives.
Print Assumptions never_stuck.
