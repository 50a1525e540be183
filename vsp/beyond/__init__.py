"""Beyond the paper: our own method (refinement), the best possible returns (optimum), explanations, comparisons with
other methods, and benchmarks."""
