(** The check that Coq evaluates. The square is cut into 300 x 300 boxes. Box (i, j) holds the states whose 300 x lies
    between i and i + 1, and 300 y between j and j + 1. All numbers are integers. They count units of which 2^24 make
    the width of a box and 5033164800 = 300 * 2^24 the side of the square. Bounds are rounded outwards.

    Each box has a rank. From a box of rank r every step must lead into boxes that lie in the goal or have a smaller
    rank, so that the goal is reached in at most r + 1 steps. Where ranks come from does not matter. *)

From Coq Require Import List QArith Qround ZArith FMapPositive.
From Coq.Strings Require Import Byte.
From VSP Require Import Statement.
Open Scope Z_scope.

Definition side := 5033164800.
Definition tenth := 503316480.
Definition spread := 4800. (* the largest error of a step, 2^-20 of the side *)
Definition bound low high v := Z.max low (Z.min high v).

(** A lower bound of p x + q y + r over a box: its smallest value there is taken in one of the corners. The coefficients
    are rounded down, which bounds the value because x and y are not negative. *)
Record form := Form { a : Z; b : Z; c : Z }.
Definition rounded (p q r : Q) :=
  let a := Qfloor (p * 16777216) in let b := Qfloor (q * 16777216) in
  Form a b (Qfloor (r * 5033164800) + Z.min a 0 + Z.min b 0).
Definition least f i j := i * a f + j * b f + c f.

(** What the check needs of an equation: lower bounds of a tenth of the action, of minus that, of the coordinate with
    that added, and of minus that. [u] and [v] are 1 for the coordinate that moves, and 0 for the other one. *)
Record bounds := Bounds { act : form; minus_act : form; move : form; minus_move : form }.
Definition bounds_of (u v : Q) (e : equation) :=
  let p := ((1 # 10) * per_x e)%Q in let q := ((1 # 10) * per_y e)%Q in let r := ((1 # 10) * constant e)%Q in
  Bounds (rounded p q r) (rounded (- p) (- q) (- r))
    (rounded (u + p) (v + q) r) (rounded (- (u + p)) (- (v + q)) (- r)).

(** What it needs of a cell: where another one is so much nearer that it cannot act, and where it moves. *)
Record plan := Plan { borders : list form; along_x : bounds; along_y : bounds }.
Definition border p (c other : cell) := (* distance to c minus that to the other, minus 2^-16 *)
  let sx := square (x (scale p)) in let sy := square (y (scale p)) in
  rounded (2 * (x (codeword other) - x (codeword c)) / sx) (2 * (y (codeword other) - y (codeword c)) / sy)
    ((square (x (codeword c)) - square (x (codeword other))) / sx +
     (square (y (codeword c)) - square (y (codeword other))) / sy - (1 # 2 ^ 16)).
Definition plan_of p c := Plan (map (border p c) (cells p)) (bounds_of 1 0 (for_x c)) (bounds_of 0 1 (for_y c)).

(** The least and the largest coordinate after a step from a box; k is i or j. Where no action of the box exceeds the
    upper limit, the limited action is at least the action, and coordinate and action are bounded together. *)
Definition low_end e k i j :=
  let low := k * 16777216 + bound (- tenth) tenth (least (act e) i j) in
  bound 0 side ((if - tenth <=? least (minus_act e) i j then Z.max low (least (move e) i j) else low) - spread).
Definition high_end e k i j :=
  let high := (k + 1) * 16777216 + bound (- tenth) tenth (- least (minus_act e) i j) in
  bound 0 side ((if - tenth <=? least (act e) i j then Z.min high (- least (minus_move e) i j) else high) + spread).

(** [test] holds for the n integers from k on. *)
Fixpoint all (n : nat) (k : Z) (test : Z -> bool) :=
  match n with O => true | S n => if test k then all n (k + 1) test else false end.
Definition box_of v := Z.min 299 (Z.shiftr v 24).
Definition among low high := all (Z.to_nat (box_of high - box_of low + 1)) (box_of low).

(** The check of one cell in one box of rank r. Either the cell cannot act there, or its step surely misses the pit, and
    every box that it may lead into lies in the goal or has a smaller rank. The goal is boxes 0 to 29 on both axes. *)
Definition check_cell (rank : Z -> Z -> nat) (r : nat) i j plan :=
  if forallb (fun f => least f i j <=? 0) (borders plan) then
    let x0 := low_end (along_x plan) i i j in let x1 := high_end (along_x plan) i i j in
    let y0 := low_end (along_y plan) j i j in let y1 := high_end (along_y plan) j i j in
    if (x1 <=? 4 * tenth) || (6 * tenth <=? x0) || (y1 <=? 4 * tenth) || (6 * tenth <=? y0) then
      among x0 x1 (fun i => among y0 y1 (fun j => ((i <? 30) && (j <? 30)) || (rank i j <? r)%nat))
    else false
  else true.

(** A box needs a rank below 50, unless it lies deep in the pit: boxes 148 to 152 on both axes. *)
Definition check_box rank plans i j :=
  if (rank i j <? 50)%nat then forallb (check_cell rank (rank i j) i j) plans
  else (147 <? i) && (i <? 153) && (147 <? j) && (j <? 153).
Definition check rank p :=
  negb (Qeq_bool (x (scale p)) 0) && negb (Qeq_bool (y (scale p)) 0) &&
  let plans := map (plan_of p) (cells p) in all 300 0 (fun i => all 300 0 (check_box rank plans i)).

(** Ranks from texts, one for each i. In it, the letters A, B, C, ... at place j stand for ranks 0, 1, 2, ... *)
Record row := Row { letters : list byte }.
Declare Scope row_scope.
Delimit Scope row_scope with row.
String Notation row Row letters : row_scope.
Fixpoint numbered {A} (k : positive) (all : list A) (found : PositiveMap.t A) :=
  match all with nil => found | one :: rest => numbered (Pos.succ k) rest (PositiveMap.add k one found) end.
Definition numbers_in text :=
  numbered 1 (map (fun letter => to_nat letter - 65)%nat (letters text)) (PositiveMap.empty _).
Definition rank_in texts :=
  let rows := numbered 1 (map numbers_in texts) (PositiveMap.empty _) in
  fun i j => match PositiveMap.find (Z.to_pos (i + 1)) rows with
    | Some row => match PositiveMap.find (Z.to_pos (j + 1)) row with Some r => r | None => 99%nat end
    | None => 99%nat end.
