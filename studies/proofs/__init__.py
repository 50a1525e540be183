"""Proofs that only make committed tables: of SimpleGoal's teacher, and the exact returns of its pieces."""
