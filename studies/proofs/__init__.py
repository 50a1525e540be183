"""Proofs that only make committed tables: MountainCar over the real numbers, SimpleGoal's teacher, exact returns."""
