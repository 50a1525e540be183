(** What the tests ask of Statement.v: consequences that are written in another way, and tactics for examples. *)

From Coq Require Import List QArith Qabs.
From VSP Require Import Statement Policy.
Import ListNotations.

Goal always_arrives the_policy -> forall run, (forall n, step the_policy (run n) (run (S n))) ->
  0 <= x (run O) <= 1 -> 0 <= y (run O) <= 1 -> x (run O) <= 49 # 100 \/ 51 # 100 <= y (run O) ->
  exists n, (0 < n < 51)%nat /\ in_goal (run n) /\ forall m, (m < n)%nat -> ~ in_pit (run (S m)).
Proof.
  intros arrives run steps h_x h_y not_deep. destruct (arrives run) as (n & h & goal & pits).
  - intros n _. apply steps.
  - now split.
  - intros [[low _] [_ high]]. destruct not_deep as [no | no]; [revert low | revert high]; now apply Qle_not_lt.
  - exists n. repeat split; try apply goal; try apply le_n_S; try apply h. intros m hm. apply pits.
    split; [apply le_n_S, Nat.le_0_l | exact hm].
Qed.

(** A run may do anything after the goal, also leave the square. *)
Goal always_arrives the_policy -> forall run, (forall n, step the_policy (run n) (run (S n)) \/
  exists m, (0 < m <= n)%nat /\ in_goal (run m)) -> in_square (run O) -> ~ deep_in_pit (run O) ->
  exists n, (0 < n < 51)%nat /\ in_goal (run n).
Proof.
  intros arrives run steps square not_deep. destruct (arrives run) as (n & h & goal & _); try assumption.
  - intros n before. destruct (steps n) as [? | (m & h & goal)]; [assumption|]. now destruct (before m).
  - exists n. repeat split; try apply goal; try apply le_n_S; apply h.
Qed.

Goal forall c s e_x e_y, In c (cells the_policy) ->
  (forall other, In other (cells the_policy) -> distance the_policy c s <= distance the_policy other s + (1 # 65536)) ->
  - (1 # 1048576) <= e_x <= 1 # 1048576 -> - (1 # 1048576) <= e_y <= 1 # 1048576 ->
  step the_policy s (State (moved (x s) (for_x c) s e_x) (moved (y s) (for_y c) s e_y)).
Proof.
  intros c s e_x e_y inner near h_x h_y. exists c, e_x, e_y.
  split; [now split|]. split; [now apply Qabs_Qle_condition|]. split; [now apply Qabs_Qle_condition|]. now split.
Qed.

(** A sample: state s, by cell i with errors e to t; d is the distance. *)
Definition right '(s, t, e, i, d) := match nth_error (cells the_policy) i with None => false | Some c =>
  Qeq_bool (x t) (moved (x s) (for_x c) s (x e)) && Qeq_bool (y t) (moved (y s) (for_y c) s (y e))
  && Qeq_bool d (distance the_policy c s) end.

Ltac holds := vm_compute; intuition (discriminate || congruence).
Ltac may := eexists; split; [easy|]; split; [now left|]; intros ? i; cbn in i; intuition (subst; holds).
Ltac may_not := eexists; split; [easy|]; intros [_ no]; cbn in no; pose proof (no _ (or_introl eq_refl)) as a;
  pose proof (no _ (or_intror (or_introl eq_refl))) as b; pose proof (no _ (or_intror (or_intror (or_introl eq_refl)))) as c;
  revert a b c; holds.
