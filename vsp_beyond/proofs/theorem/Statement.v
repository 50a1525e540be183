(** What is proved about SimpleGoal, in numbers without rounding. This file can be read alone; the rest is the proof.

    An agent stands at a point of the unit square. In each step a policy decides where it moves. An episode ends when a
    move ends in the goal or in the pit; the task allows 50 steps. *)

From Coq Require Import List QArith Qabs Qminmax.
Open Scope Q_scope.

Record state := State { x : Q; y : Q }.
Definition in_square s := 0 <= x s <= 1 /\ 0 <= y s <= 1.
Definition in_goal s := x s < 1 # 10 /\ y s < 1 # 10.
Definition in_pit s := 2 # 5 < x s < 3 # 5 /\ 2 # 5 < y s < 3 # 5.

(** A policy is a list of cells. Each has a codeword and two equations, whose values are the action. [scale] is the
    scale of the distance. [make theorem] writes the numbers into Data.v, exactly as the policy's file holds them. *)
Record equation := Equation { per_x : Q; per_y : Q; constant : Q }.
Record cell := Cell { codeword : state; for_x : equation; for_y : equation }.
Record policy := Policy { scale : state; cells : list cell }.

Definition square (q : Q) := q * q.
Definition distance p c s := (* squared and scaled, between a state and the codeword of a cell *)
  square ((x s - x (codeword c)) / x (scale p)) + square ((y s - y (codeword c)) / y (scale p)).

(** The nearest cell acts, and so may any other that is nearly as near. *)
Definition may_act p c s :=
  In c (cells p) /\ forall other, In other (cells p) -> distance p c s <= distance p other s + (1 # 2 ^ 16).

(** A step is a tenth of the action, which is limited to -1 to 1. An error is added; then the walls stop the agent. *)
Definition clip (low high q : Q) := Qmax low (Qmin high q).
Definition value e s := per_x e * x s + per_y e * y s + constant e.
Definition moved q e s error := clip 0 1 (q + (1 # 10) * clip (-1) 1 (value e s) + error).
Definition small error := Qabs (x error) <= 1 # 2 ^ 20 /\ Qabs (y error) <= 1 # 2 ^ 20.
Definition step p s t := exists c error, may_act p c s /\ small error /\
  x t == moved (x s) (for_x c) s (x error) /\ y t == moved (y s) (for_y c) s (y error).

(** A run is a sequence of states, each a step from the one before, as long as none after the start is in the goal.
    In each step cell and error may be any that are allowed, so nothing is assumed about them. *)
Definition is_run p (run : nat -> state) :=
  forall n, (forall m, (1 <= m <= n)%nat -> ~ in_goal (run m)) -> step p (run n) (run (S n)).

(** From every start in the square outside the pit, every run is in the goal after 1 to 50 steps, and not in the pit
    before. (A run can always go on: [a_step_exists] in Sound.v.) *)
Definition always_arrives p := forall run, is_run p run -> in_square (run O) -> ~ in_pit (run O) ->
  exists n, (1 <= n <= 50)%nat /\ in_goal (run n) /\ forall m, (m <= n)%nat -> ~ in_pit (run m).
