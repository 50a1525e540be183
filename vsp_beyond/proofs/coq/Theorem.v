(** The theorem. Coq evaluates the check of all boxes, and verifies the proof. *)

From Coq Require Import QArith Lqa.
From VSP Require Import Statement Check Sound Policy Ranks.

Theorem simplegoal_always_arrives : always_arrives the_policy.
Proof. apply (sound _ (rank_in ranks)). vm_cast_no_check (eq_refl true). Qed.

(** It is about something: there are runs from every start. *)
Theorem runs_exist s : exists run, is_run the_policy run /\ run 0%nat = s.
Proof. now apply a_run_exists. Qed.

(** A run that starts outside the pit is never in it until it is in the goal. *)
Corollary outside_the_pit run : is_run the_policy run -> in_square (run 0%nat) -> ~ in_pit (run 0%nat) ->
  exists n, (1 <= n <= 50)%nat /\ in_goal (run n) /\ forall m, (m <= n)%nat -> ~ in_pit (run m).
Proof.
  intros is_run square no_pit. destruct (simplegoal_always_arrives run is_run square) as (n & range & goal & no_pits).
  - intros [? ?]. apply no_pit. unfold in_pit. repeat split; lra.
  - exists n. repeat split; try apply range; try apply goal. intros [|m] Hm; [assumption|].
    apply no_pits. split; [apply le_n_S, Nat.le_0_l | assumption].
Qed.

Print Assumptions simplegoal_always_arrives.
Print Assumptions runs_exist.
Print Assumptions outside_the_pit.
