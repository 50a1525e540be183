"""Beyond the paper: our own method (refinement), the best possible returns (optimum), two
walking robots (robots), what can be proved (proofs), explanations, comparisons with other methods, and benchmarks."""
