"""Proofs that only make committed tables: of MountainCar over the real numbers, and of SimpleGoal's teacher."""
