(** What is claimed about SimpleGoal, in exact rationals. Theorem.v asserts [always_arrives the_policy]. Coq cannot
    check two things: that Policy.v holds the numbers of the policy's file, which Python transcribes in [make theorem],
    and that the task is as defined here. Tests compare both, the task in 100,000 steps.

    An agent stands at a point of the unit square. In each step a policy decides where it moves. An episode ends when a
    move leads into the goal or into the pit. The task allows 50 steps. *)

From Coq Require Import List QArith Qabs Qminmax.
Open Scope Q_scope.

Record state := State { x : Q; y : Q }.
Definition in_square s := 0 <= x s <= 1 /\ 0 <= y s <= 1.
Definition in_goal s := x s < 1 # 10 /\ y s < 1 # 10.
Definition in_pit s := 2 # 5 < x s < 3 # 5 /\ 2 # 5 < y s < 3 # 5.
Definition deep_in_pit s := 49 # 100 < x s < 51 # 100 /\ 49 # 100 < y s < 51 # 100.

(** A policy is a list of cells. A cell has a codeword and two equations, one for each coordinate of the action. *)
Record equation := Equation { per_x : Q; per_y : Q; constant : Q }.
Record cell := Cell { codeword : state; for_x : equation; for_y : equation }.
Record policy := Policy { scale : state; cells : list cell }.

(** The squared distance of a state from a cell's codeword, after both were divided by the scale. *)
Definition square (q : Q) := q * q.
Definition distance p c s :=
  square ((x s - x (codeword c)) / x (scale p)) + square ((y s - y (codeword c)) / y (scale p)).

(** The nearest cell acts, or any that is nearly as near: its squared distance exceeds no other by more than 2^-16. *)
Definition may_act p c s :=
  In c (cells p) /\ forall other, In other (cells p) -> distance p c s <= distance p other s + (1 # 2 ^ 16).

(** A step adds to each coordinate [q] a tenth of the action, which is limited to -1 to 1, and an error of at most
    2^-20. Then the walls stop the agent. *)
Definition clip (low high q : Q) := Qmax low (Qmin high q).
Definition value e s := per_x e * x s + per_y e * y s + constant e.
Definition moved q e s error := clip 0 1 (q + (1 # 10) * clip (-1) 1 (value e s) + error).
Definition small error := Qabs error <= 1 # 2 ^ 20.
Definition step p s t := exists c error_x error_y, may_act p c s /\ small error_x /\ small error_y /\
  x t == moved (x s) (for_x c) s error_x /\ y t == moved (y s) (for_y c) s error_y.

(** A run is a sequence of states, number 0 the start. Each next one is a step from the one before, as long as none
    after the start is in the goal. Cell and errors are chosen anew in each step, in any way that is allowed. *)
Definition is_run p (run : nat -> state) :=
  forall n, (forall m, (1 <= m <= n)%nat -> ~ in_goal (run m)) -> step p (run n) (run (S n)).

(** From every start in the square, except deep in the pit, every run is in the goal after 1 to 50 steps, and no step
    until then leads into the pit. (Runs exist from every start: [runs_exist] in Theorem.v.) *)
Definition always_arrives p := forall run, is_run p run -> in_square (run 0%nat) -> ~ deep_in_pit (run 0%nat) ->
  exists n, (1 <= n <= 50)%nat /\ in_goal (run n) /\ forall m, (1 <= m <= n)%nat -> ~ in_pit (run m).
