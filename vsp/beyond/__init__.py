"""Beyond the paper: our own method (refinement), the best possible returns (optimum), what can be
proved (proofs), explanations, comparisons with other methods, and benchmarks."""
