(** From boxes to states: whatever the ranks are, if the check succeeds, the policy always arrives. *)

From Coq Require Import List QArith Qabs Qminmax Qround ZArith Lia Lqa Bool.
From VSP Require Import Statement Check.
Open Scope Q_scope.

(** Integers as bounds of rational numbers. *)
Ltac rational :=
  repeat match goal with
  | H : (_ <= _)%Z |- _ => rewrite Zle_Qle in H
  | H : (_ < _)%Z |- _ => rewrite Zlt_Qlt in H
  | |- (_ <= _)%Z => rewrite Zle_Qle
  | |- (_ < _)%Z => rewrite Zlt_Qlt
  end;
  unfold side, tenth, spread, Z.sub in *;
  repeat rewrite ?inject_Z_plus, ?inject_Z_opp, ?inject_Z_mult in *;
  repeat match goal with
  | |- context [inject_Z (Zpos ?z)] => change (inject_Z (Zpos z)) with (Zpos z # 1)
  | H : context [inject_Z (Zpos ?z)] |- _ => change (inject_Z (Zpos z)) with (Zpos z # 1) in H
  | |- context [inject_Z 0] => change (inject_Z 0) with (0 # 1)
  | H : context [inject_Z 0] |- _ => change (inject_Z 0) with (0 # 1) in H
  end.

Definition inside k (q : Q) := inject_Z k <= 300 * q <= inject_Z k + 1.

Lemma product k a p q : (0 <= k)%Z -> inside k q -> inject_Z a <= p * 16777216 ->
  inject_Z (k * a + Z.min a 0) <= 5033164800 * (p * q).
Proof.
  intros Hk [low high] Ha.
  assert (inject_Z a * (300 * q) <= p * 16777216 * (300 * q)) by (apply Qmult_le_compat_r; rational; lra).
  assert (inject_Z (k * a + Z.min a 0) <= inject_Z a * (300 * q)); [|lra].
  destruct (Z.min_spec a 0) as [[sign ->] | [sign ->]]; rational; nra.
Qed.

Lemma least_ok p q r s i j : (0 <= i)%Z -> (0 <= j)%Z -> inside i (x s) -> inside j (y s) ->
  inject_Z (least (rounded p q r) i j) <= 5033164800 * (p * x s + q * y s + r).
Proof.
  intros Hi Hj Hx Hy.
  pose proof (product i _ p (x s) Hi Hx (Qfloor_le _)). pose proof (product j _ q (y s) Hj Hy (Qfloor_le _)).
  pose proof (Qfloor_le (r * 5033164800)). unfold least, rounded; cbn [a b c].
  revert H H0 H1; rational; lra.
Qed.

Lemma bounds_ok u v e s i j (b := bounds_of u v e) (action := (1 # 10) * value e s) :
  (0 <= i)%Z -> (0 <= j)%Z -> inside i (x s) -> inside j (y s) ->
  inject_Z (least (act b) i j) <= 5033164800 * action /\
  inject_Z (least (minus_act b) i j) <= - (5033164800 * action) /\
  inject_Z (least (move b) i j) <= 5033164800 * (u * x s + v * y s + action) /\
  inject_Z (least (minus_move b) i j) <= - (5033164800 * (u * x s + v * y s + action)).
Proof.
  intros. unfold b, action, bounds_of, value; cbn [act minus_act move minus_move].
  repeat split; (eapply Qle_trans; [apply least_ok; eassumption | lra]).
Qed.

Lemma clip_cases low high q : low <= high ->
  q <= low /\ clip low high q == low \/ low <= q <= high /\ clip low high q == q \/
  high <= q /\ clip low high q == high.
Proof.
  intros. unfold clip. destruct (Q.min_spec high q) as [[? e] | [? e]];
  destruct (Q.max_spec low (Qmin high q)) as [[? e'] | [? e']]; lra.
Qed.

Lemma bound_least k low high l h z q : 0 <= k -> l <= h -> inject_Z low == k * l -> inject_Z high == k * h ->
  inject_Z z <= k * q -> inject_Z (bound low high z) <= k * clip l h q.
Proof.
  intros. unfold bound. pose proof (clip_cases l h q).
  destruct (Z.min_spec high z) as [[? ->] | [? ->]];
  [destruct (Z.max_spec low high) as [[? ->] | [? ->]] | destruct (Z.max_spec low z) as [[? ->] | [? ->]]];
  rational; nra.
Qed.

Lemma bound_most k low high l h z q : 0 <= k -> l <= h -> inject_Z low == k * l -> inject_Z high == k * h ->
  k * q <= inject_Z z -> k * clip l h q <= inject_Z (bound low high z).
Proof.
  intros. unfold bound. pose proof (clip_cases l h q).
  destruct (Z.min_spec high z) as [[? ->] | [? ->]];
  [destruct (Z.max_spec low high) as [[? ->] | [? ->]] | destruct (Z.max_spec low z) as [[? ->] | [? ->]]];
  rational; nra.
Qed.

Lemma ends_ok u v e s i j k q error (b := bounds_of u v e) :
  (0 <= i)%Z -> (0 <= j)%Z -> inside i (x s) -> inside j (y s) -> inside k q -> u * x s + v * y s == q ->
  small error ->
  inject_Z (low_end b k i j) <= 5033164800 * moved q e s error <= inject_Z (high_end b k i j).
Proof.
  intros Hi Hj Hx Hy [low high] Hq size. apply Qabs_Qle_condition in size. cbn [Pos.pow Pos.iter Pos.mul] in size.
  destruct (bounds_ok u v e s i j Hi Hj Hx Hy) as (A & A' & M & M'). fold b in A, A', M, M'.
  assert (-1 <= 1) as limits by easy. apply (clip_cases _ _ (value e s)) in limits.
  assert (inject_Z (bound (- tenth) tenth (least (act b) i j)) <= 503316480 * clip (-1) 1 (value e s)).
  { apply bound_least; try easy; lra. }
  assert (503316480 * clip (-1) 1 (value e s) <= inject_Z (bound (- tenth) tenth (- least (minus_act b) i j))).
  { apply bound_most; try easy; rational; lra. }
  unfold low_end, high_end, moved. split.
  - apply bound_least; try reflexivity; try lra.
    destruct (Z.leb_spec (- tenth) (least (minus_act b) i j)) as [free | _].
    + destruct (Z.max_spec (k * 16777216 + bound (- tenth) tenth (least (act b) i j)) (least (move b) i j))
        as [[? ->] | [? ->]]; rational; lra.
    + rational; lra.
  - apply bound_most; try reflexivity; try lra.
    destruct (Z.leb_spec (- tenth) (least (act b) i j)) as [free | _].
    + destruct (Z.min_spec ((k + 1) * 16777216 + bound (- tenth) tenth (- least (minus_act b) i j))
        (- least (minus_move b) i j)) as [[? ->] | [? ->]]; rational; lra.
    + rational; lra.
Qed.

(** The box of a state. *)
Definition place (q : Q) := Z.min 299 (Qfloor (300 * q)).

Lemma place_ok q : 0 <= q <= 1 ->
  (0 <= place q < 300)%Z /\ inside (place q) q /\ ((place q < 299)%Z -> 300 * q < inject_Z (place q) + 1).
Proof.
  intros. unfold place, inside. pose proof (Qfloor_le (300 * q)). pose proof (Qlt_floor (300 * q)).
  assert (0 <= Qfloor (300 * q))%Z by (apply (Qfloor_resp_le 0); lra).
  destruct (Z.min_spec 299 (Qfloor (300 * q))) as [[? ->] | [? ->]]; (split; [lia|]);
  repeat split; intros; rational; lra.
Qed.

Lemma box_of_ok low high q : inject_Z low <= 5033164800 * q <= inject_Z high ->
  (box_of low <= place q <= box_of high)%Z.
Proof.
  intros [l h]. unfold box_of, place. rewrite !Z.shiftr_div_pow2 by easy. change (2 ^ 24)%Z with 16777216%Z.
  assert (low / 16777216 <= Qfloor (300 * q))%Z.
  { rewrite <- (Qfloor_Z (low / 16777216)). apply Qfloor_resp_le.
    pose proof (Z.mul_div_le low 16777216 eq_refl). rational. lra. }
  assert (Qfloor (300 * q) <= high / 16777216)%Z; [|lia].
  apply Z.div_le_lower_bound; [easy|]. pose proof (Qfloor_le (300 * q)). rational. lra.
Qed.

Lemma all_ok n : forall k test, all n k test = true -> forall m, (k <= m < k + Z.of_nat n)%Z -> test m = true.
Proof.
  induction n; cbn [all]; intros k test; [lia|]. destruct (test k) eqn:first; [|discriminate]. intros rest m range.
  destruct (Z.eq_dec m k) as [-> | ]; [assumption|]. apply (IHn (k + 1)%Z); [assumption | lia].
Qed.

Lemma among_ok low high test q : among low high test = true -> inject_Z low <= 5033164800 * q <= inject_Z high ->
  test (place q) = true.
Proof. intros found within. apply box_of_ok in within. apply (all_ok _ _ _ found). lia. Qed.

Section Policy.
Variables (p : policy) (rank : Z -> Z -> nat).
Hypothesis scale_x : ~ x (scale p) == 0.
Hypothesis scale_y : ~ y (scale p) == 0.

Lemma borders_ok c s i j : (0 <= i)%Z -> (0 <= j)%Z -> inside i (x s) -> inside j (y s) -> may_act p c s ->
  forallb (fun f => least f i j <=? 0)%Z (borders (plan_of p c)) = true.
Proof.
  intros Hi Hj Hx Hy [_ near]. apply forallb_forall. intros f found. cbn in found.
  apply in_map_iff in found as (other & <- & there). apply Z.leb_le. specialize (near other there). rewrite Zle_Qle.
  eapply Qle_trans; [apply least_ok; eassumption|].
  assert (distance p c s - distance p other s - (1 # 2 ^ 16) <= 0) as no_nearer by lra.
  match goal with |- 5033164800 * ?form <= _ =>
    assert (form == distance p c s - distance p other s - (1 # 2 ^ 16)) as -> end.
  - unfold distance, square. field. auto.
  - rational. lra.
Qed.

Lemma in_place s : in_square s ->
  ((0 <= place (x s) < 300) /\ (0 <= place (y s) < 300))%Z /\ inside (place (x s)) (x s) /\ inside (place (y s)) (y s).
Proof. intros [X Y]. pose proof (place_ok _ X). pose proof (place_ok _ Y). tauto. Qed.

(** One step from a box that is checked. *)
Lemma step_ok r s t (i := place (x s)) (j := place (y s)) : in_square s -> step p s t ->
  forallb (check_cell rank r i j) (map (plan_of p) (cells p)) = true ->
  in_square t /\ ~ in_pit t /\ (in_goal t \/ rank (place (x t)) (place (y t)) < r)%nat.
Proof.
  intros square (c & error_x & error_y & near & ex & ey & tx & ty) checked.
  destruct (in_place s square) as ([Hi Hj] & Hx & Hy). fold i j in Hi, Hj, Hx, Hy.
  rewrite forallb_forall in checked. specialize (checked (plan_of p c) (in_map _ _ _ (proj1 near))).
  unfold check_cell in checked. rewrite (borders_ok c s i j) in checked by tauto.
  cbn [along_x along_y plan_of] in checked.
  assert (1 * x s + 0 * y s == x s) as ux by ring. assert (0 * x s + 1 * y s == y s) as uy by ring.
  pose proof (ends_ok _ _ (for_x c) s i j i _ _ (proj1 Hi) (proj1 Hj) Hx Hy Hx ux ex) as X. rewrite <- tx in X.
  pose proof (ends_ok _ _ (for_y c) s i j j _ _ (proj1 Hi) (proj1 Hj) Hx Hy Hy uy ey) as Y. rewrite <- ty in Y.
  assert (in_square t) as inner.
  { unfold in_square. rewrite tx, ty. unfold moved. split; split.
    1, 3: apply Q.le_max_l. all: apply Q.max_lub; [easy | apply Q.le_min_l]. }
  destruct (_ || _)%bool eqn:outside in checked; [|discriminate].
  split; [assumption|]. split.
  - intros [[? ?] [? ?]]. rewrite !orb_true_iff, !Z.leb_le in outside.
    destruct outside as [[[o | o] | o] | o]; rational; lra.
  - apply (among_ok _ _ _ (x t)) in checked; [|assumption]. apply (among_ok _ _ _ (y t)) in checked; [|assumption].
    rewrite orb_true_iff, andb_true_iff, !Z.ltb_lt, Nat.ltb_lt in checked.
    destruct checked as [[goal_x goal_y] | ?]; [|auto].
    left. destruct inner as [tx' ty']. pose proof (place_ok _ tx'). pose proof (place_ok _ ty').
    assert (place (x t) + 1 <= 30 /\ place (y t) + 1 <= 30)%Z as [? ?] by lia.
    assert (300 * x t < inject_Z (place (x t)) + 1 /\ 300 * y t < inject_Z (place (y t)) + 1)
      by (split; [apply H | apply H0]; lia).
    split; rational; lra.
Qed.

Lemma check_ok : check rank p = true -> forall i j, (0 <= i < 300)%Z -> (0 <= j < 300)%Z ->
  check_box rank (map (plan_of p) (cells p)) i j = true.
Proof.
  unfold check. rewrite !andb_true_iff. intros [_ found] i j Hi Hj.
  apply (all_ok _ _ _ found i) in Hi. exact (all_ok _ _ _ Hi j Hj).
Qed.

Lemma goal_or_not s : in_goal s \/ ~ in_goal s.
Proof.
  unfold in_goal. destruct (Qlt_le_dec (x s) (1 # 10)), (Qlt_le_dec (y s) (1 # 10)); [left; auto | right ..]; lra.
Qed.

(** From a box of rank r the goal is reached in at most r + 1 more steps. *)
Lemma arrives run (checked : check rank p = true) : is_run p run -> forall r n, in_square (run n) ->
  rank (place (x (run n))) (place (y (run n))) = r -> (r < 50)%nat ->
  (forall m, 1 <= m <= n -> ~ in_goal (run m))%nat ->
  exists last, (n < last <= n + r + 1)%nat /\ in_goal (run last) /\ forall m, (n < m <= last)%nat -> ~ in_pit (run m).
Proof.
  intros is_run r. induction r as [r induction] using lt_wf_ind. intros n square Hr small before.
  destruct (in_place _ square) as ([Hi Hj] & _). pose proof (check_ok checked _ _ Hi Hj) as box.
  unfold check_box in box. rewrite Hr in box. rewrite (proj2 (Nat.ltb_lt r 50) small) in box.
  destruct (step_ok _ _ _ square (is_run n before) box) as (square' & no_pit & next).
  destruct (goal_or_not (run (S n))) as [goal | no_goal].
  - exists (S n). repeat split; try lia; try apply goal. intros m Hm. replace m with (S n) by lia. assumption.
  - destruct next as [? | lower]; [contradiction|].
    destruct (induction _ lower (S n) square' eq_refl) as (last & range & goal & no_pits); [lia | |].
    { intros m Hm. destruct (Nat.eq_dec m (S n)) as [-> |]; [assumption | apply before; lia]. }
    exists last. repeat split; try lia; try apply goal. intros m Hm.
    destruct (Nat.eq_dec m (S n)) as [-> |]; [assumption | apply no_pits; lia].
Qed.
End Policy.

Theorem sound p rank : check rank p = true -> always_arrives p.
Proof.
  intros checked run is_run square not_deep. pose proof checked as found. unfold check in found.
  rewrite !andb_true_iff, !negb_true_iff in found. destruct found as [[sx sy] _].
  apply Qeq_bool_neq in sx, sy. destruct (in_place _ square) as ([Hi Hj] & Hx & Hy).
  pose proof (check_ok p rank checked _ _ Hi Hj) as box. unfold check_box in box.
  destruct (Nat.ltb_spec (rank (place (x (run O))) (place (y (run O)))) 50) as [ranked | _].
  - destruct (arrives p rank sx sy run checked is_run _ O square eq_refl ranked)
      as (n & range & goal & no_pits); [lia|].
    exists n. repeat split; try lia; try apply goal. intros m Hm. apply no_pits. lia.
  - contradict not_deep. rewrite !andb_true_iff, !Z.ltb_lt in box. destruct box as [[[x0 x1] y0] y1].
    destruct square as [X Y]. destruct (place_ok _ X) as (_ & _ & X1), (place_ok _ Y) as (_ & _ & Y1).
    specialize (X1 ltac:(lia)). specialize (Y1 ltac:(lia)). unfold inside in *.
    assert (148 <= place (x (run O)) <= 152 /\ 148 <= place (y (run O)) <= 152)%Z as [[? ?] [? ?]] by lia.
    split; split; rational; lra.
Qed.

(** A run from every start: without errors, by the nearest cell. *)
Fixpoint nearest p s c others :=
  match others with nil => c | other :: rest =>
    nearest p s (if Qle_bool (distance p c s) (distance p other s) then c else other) rest end.
Definition next p s :=
  match cells p with nil => s | first :: rest => let c := nearest p s first rest in
    State (moved (x s) (for_x c) s 0) (moved (y s) (for_y c) s 0) end.

Lemma nearest_ok p s others : forall c, In (nearest p s c others) (c :: others) /\
  forall other, In other (c :: others) -> distance p (nearest p s c others) s <= distance p other s.
Proof.
  induction others as [|one rest nearer]; intros c; cbn [nearest].
  - split; [now left|]. intros other [-> | []]. apply Qle_refl.
  - destruct (Qle_bool (distance p c s) (distance p one s)) eqn:first.
    + apply Qle_bool_iff in first. destruct (nearer c) as [found least]. split; [cbn in *; tauto|].
      intros other [-> | [-> | there]]; [apply least; now left | | apply least; now right].
      exact (Qle_trans _ _ _ (least c (or_introl eq_refl)) first).
    + assert (distance p one s <= distance p c s) as second.
      { apply Qlt_le_weak, Qnot_le_lt. intros le. apply Qle_bool_iff in le. congruence. }
      destruct (nearer one) as [found least]. split; [now right|].
      intros other [-> | there]; [|now apply least]. exact (Qle_trans _ _ _ (least one (or_introl eq_refl)) second).
Qed.

Theorem a_run_exists p s : cells p <> nil -> exists run, is_run p run /\ run 0%nat = s.
Proof.
  intros some. exists (fun n => Nat.iter n (next p) s). split; [|reflexivity]. intros n _.
  change (let t := Nat.iter n (next p) s in step p t (next p t)). intros t. unfold next.
  destruct (cells p) as [|first rest] eqn:all; [easy|].
  destruct (nearest_ok p t rest first) as [found least]. rewrite <- all in found, least.
  exists (nearest p t first rest), 0, 0. split; [split; [exact found|] | now repeat apply conj; try apply Qeq_refl].
  intros other there. specialize (least other there). assert (0 <= 1 # 2 ^ 16) by easy. lra.
Qed.
